// What the page carries: JSON and arrays of whole numbers, compressed (phexfab/report/pack.py).
async function unpack() {
  if (!("DecompressionStream" in globalThis))
    throw new Error("The 3-D view needs a browser of 2023 or later (Chrome 80, Firefox 113, Safari 16.4)");
  const text = atob(document.getElementById("report-data").textContent), packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = await new Response(stream).arrayBuffer(), size = new DataView(bytes).getUint32(0, true);
  const kinds = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };
  const json = new TextDecoder().decode(new Uint8Array(bytes, 4, size));
  return JSON.parse(json, (_, value) =>
    value && value.type in kinds ? new kinds[value.type](bytes, 4 + size + value.at, value.count) : value);
}
