"use strict";
// Decoding of a bundle: rsibr/publishing/bundle/encoding.py is the other half.
(() => {
  const KINDS = { half: Uint16Array, float: Float32Array, short: Int16Array, uint: Uint32Array };

  /** Bundle of a script tag: what its JSON holds, and `arrays` of {type, shape, scale, data} with typed arrays.
   *  Half numbers stay the patterns of 16 bits that they are. */
  rsibr.decodeBundle = async function decodeBundle(element) {
    const { arrays, ...meta } = JSON.parse(element.textContent);
    if (meta.format !== rsibr.FORMAT) {
      throw new rsibr.Unsupported(`This page holds data of format ${meta.format}, its engine reads ${rsibr.FORMAT}.`);
    }
    const names = Object.keys(arrays);
    const decoded = await Promise.all(names.map((name) => decoded_array(arrays[name])));
    return { ...meta, arrays: Object.fromEntries(names.map((name, k) => [name, decoded[k]])) };
  };

  async function decoded_array({ type, shape, scale, image, data }) {
    const planes = await inflated(bytes_of(data));
    const numbers = together(planes, KINDS[type]);
    if (image) restore(numbers, shape);
    return { type, shape, scale, data: numbers };
  }

  function bytes_of(text) {
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
    const binary = atob(text);
    const bytes = new Uint8Array(binary.length);
    for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
    return bytes;
  }

  async function inflated(bytes) {
    if (typeof DecompressionStream === "undefined") {
      throw new rsibr.Unsupported("This browser cannot unpack gzip (DecompressionStream): it needs one of 2023 or later.");
    }
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  /** Numbers of which the lowest bytes come first, then the second bytes, and so on. */
  function together(planes, Kind) {
    const width = Kind.BYTES_PER_ELEMENT, count = planes.length / width;
    const bytes = new Uint8Array(planes.length);
    for (let k = 0; k < width; k++) {
      const plane = planes.subarray(k * count, (k + 1) * count);
      for (let i = 0, at = k; i < count; i++, at += width) bytes[at] = plane[i];
    }
    return new Kind(bytes.buffer);
  }

  /** Undo the prediction of images (…, 3, H, W) in place: median of left, upper, left + upper − upper left. */
  function restore(numbers, shape) {
    const [height, width] = shape.slice(-2), plane = height * width;
    for (let start = 0; start < numbers.length; start += plane) {
      for (let row = 0, at = start; row < height; row++) {
        for (let column = 0; column < width; column++, at++) {
          const left = column ? numbers[at - 1] : 0, upper = row ? numbers[at - width] : 0;
          const corner = row && column ? numbers[at - width - 1] : 0;
          const low = left < upper ? left : upper, high = left < upper ? upper : left;
          const guess = corner >= high ? low : corner <= low ? high : left + upper - corner;
          const rest = numbers[at];
          numbers[at] = guess + ((rest >>> 1) ^ -(rest & 1));
        }
      }
    }
    for (let red = 0; red < numbers.length; red += 3 * plane) {
      for (let i = 0; i < plane; i++) {
        const green = numbers[red + plane + i];
        numbers[red + i] += green;
        numbers[red + 2 * plane + i] += green;
      }
    }
  }
})();
