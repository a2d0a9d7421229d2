"use strict";
// Numbers of 16 bits and back.
(() => {
  let table = null;

  /** Single numbers of half ones, given as patterns of 16 bits. */
  rsibr.fromHalf = function fromHalf(patterns, scale = 1) {
    table = table || Float32Array.from({ length: 65536 }, (_, bits) => {
      const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, mantissa = bits & 1023;
      if (exponent === 31) return mantissa ? NaN : sign * Infinity;
      return sign * (exponent ? 2 ** (exponent - 15) * (1 + mantissa / 1024) : (2 ** -14 * mantissa) / 1024);
    });
    const numbers = new Float32Array(patterns.length);
    for (let i = 0; i < numbers.length; i++) numbers[i] = table[patterns[i]] * scale;
    return numbers;
  };

  /** Single numbers of a bundle's array. */
  rsibr.numbers = ({ type, data, scale }) => (type === "half" ? rsibr.fromHalf(data, scale) : data);
})();
