"use strict";
// Error of what this browser or this graphics card cannot do, or a page that fits no engine: one clear sentence.
rsibr.Unsupported = class Unsupported extends Error {
  constructor(message) {
    super(message);
    this.name = "Unsupported";
  }
};
