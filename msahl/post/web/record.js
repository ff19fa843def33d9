// Pictures of a frame, and films of a stretch of the motion, made of evenly spaced frames.

const RATE = 30; // frames of a film in a second

// Returns a picture of what `draw` draws on the canvas now.
export function pictureOf(canvas, draw) {
  draw(); // the drawing is gone after the page has been shown
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

export function canFilm(canvas) {
  return typeof MediaRecorder === "function" && typeof canvas.captureStream === "function";
}

// Returns a film from a time to another at a speed: `drawAt(time)` draws each of its frames, which
// are 1/30 s of the film apart however long drawing takes. `goesOn()` says whether to go on.
export async function filmOf(canvas, { from, to, speed, drawAt, goesOn }) {
  const stream = canvas.captureStream(0);
  const [track] = stream.getVideoTracks();
  const type = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"].find((name) => MediaRecorder.isTypeSupported(name));
  const recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: 12_000_000 });
  const parts = [];
  recorder.addEventListener("dataavailable", (event) => parts.push(event.data));
  const stopped = new Promise((resolve) => recorder.addEventListener("stop", resolve));
  recorder.start();
  const frames = Math.max(Math.ceil(((to - from) / speed) * RATE), 1);
  const begin = performance.now();
  for (let frame = 0; frame <= frames && goesOn(frame / frames); frame++) {
    drawAt(Math.min(from + (frame * speed) / RATE, to));
    track.requestFrame();
    // The recorder takes its times from the clock.
    const due = begin + ((frame + 1) * 1000) / RATE;
    await new Promise((resolve) => setTimeout(resolve, Math.max(due - performance.now(), 4)));
  }
  recorder.stop();
  await stopped;
  track.stop();
  return new Blob(parts, { type: "video/webm" });
}
