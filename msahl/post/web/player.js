// The time that is shown, and how it goes on.
import { nearestTo, placeOf } from "./motion.js";

export const SLOWEST = 0.01;
export const FASTEST = 100;

const SHORT = 0.2; // s: a shorter motion is slowed down at first
const LONG = 200; // s: a longer one is sped up

// Returns the speed at which a motion of this length [s] is played at first: a power of ten, 1 unless
// it would be over before it is seen, or take minutes.
export function firstSpeed(end) {
  if (end >= SHORT && end <= LONG) return 1;
  const lasting = end < SHORT ? 1 : 20; // s, at least
  const speed = 10 ** Math.floor(Math.log10(end / lasting));
  return Math.min(Math.max(speed, SLOWEST), FASTEST);
}

export class Player {
  // `steps` are the times to step and scrub to; `changed` is called after every change.
  constructor(end, steps, changed) {
    Object.assign(this, { end, steps, changed, time: 0, speed: end > 0 ? firstSpeed(end) : 1, isPlaying: false, isLoop: true });
    this.last = null;
  }

  play(isPlaying = !this.isPlaying) {
    if (this.end <= 0) return;
    if (isPlaying && this.time >= this.end) this.time = 0;
    this.isPlaying = isPlaying;
    this.last = null;
    this.changed();
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.end);
    this.changed();
  }

  // To the nearest output time.
  scrub(time) {
    this.seek(this.steps[nearestTo(this.steps, time)]);
  }

  // By a number of output times.
  step(count) {
    this.isPlaying = false;
    const { steps, time } = this;
    let place = placeOf(steps, time);
    if (count < 0 && steps[place] < time) place += 1;
    this.seek(steps[Math.min(Math.max(place + count, 0), steps.length - 1)]);
  }

  setSpeed(speed) {
    this.speed = Math.min(Math.max(speed, SLOWEST), FASTEST);
    this.changed();
  }

  // Lets the time go on; `now` is the clock of the page [ms].
  tick(now) {
    if (!this.isPlaying) return;
    // After a pause of the page the motion goes on where it was.
    const passed = this.last === null ? 0 : Math.min((now - this.last) / 1000, 0.25);
    this.last = now;
    let time = this.time + passed * this.speed;
    if (time >= this.end) {
      if (this.isLoop) time %= this.end;
      else this.isPlaying = false;
    }
    this.seek(time);
  }
}
