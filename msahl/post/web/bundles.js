// Data and vendored libraries that a page holds compressed.

// Returns the bytes of a text in base64 that holds them compressed (zlib).
export async function unpack(text) {
  const packed = Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

const loading = new Map();

// Runs a vendored bundle of the page, once; it then stands in its global (THREE, uPlot).
export function loadBundle(name) {
  if (!loading.has(name)) loading.set(name, runBundle(name));
  return loading.get(name);
}

async function runBundle(name) {
  const held = document.getElementById(`bundle-${name}`);
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await unpack(held.textContent));
  document.head.append(script);
}

// Returns the value of an element of JSON.
export function readJson(id) {
  return JSON.parse(document.getElementById(id).textContent);
}
