// Which moment an address asks for.
"use strict";

const hydrograd = {};

/** `#t=1.5` asks for that moment (s), `#t=1.5&play` to go on from there. */
hydrograd.moment = (hash) => {
  const found = /[#&]t=([-+.\deE]+)/.exec(hash);
  return { time: found ? Number(found[1]) : undefined, play: /[#&]play\b/.test(hash) };
};
