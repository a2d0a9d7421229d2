"use strict";
/** Places of squares in one rectangle, on shelves: {width, height, corners}. Sides are given in falling order. */
rsibr.atlas = function atlas(sides) {
  const width = 2 * sides[0], corners = [];
  let x = 0, y = 0, shelf = 0;
  for (const side of sides) {
    if (x + side > width) [x, y, shelf] = [0, y + shelf, 0];
    corners.push([x, y]);
    x += side;
    shelf = Math.max(shelf, side);
  }
  return { width, height: y + shelf, corners };
};
