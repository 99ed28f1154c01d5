// A small plot of one quantity against time, that scrubs.
"use strict";

hydrograd.Plot = class {
  /** Over the player's range. */
  constructor(canvas, player, seek) {
    this.canvas = canvas;
    this.player = player;
    const scrub = (event) => {
      if (event.buttons !== 1) return;
      const box = canvas.getBoundingClientRect();
      const share = (event.clientX - box.left - 6) / (box.width - 12);
      seek(player.first + Math.min(Math.max(share, 0), 1) * (player.last - player.first));
    };
    canvas.addEventListener("pointerdown", scrub);
    canvas.addEventListener("pointermove", scrub);
  }

  /** What is drawn: numbers, one a frame, NaN where there are none. */
  take(values, unit) {
    this.values = values;
    this.unit = unit;
    const finite = [...values].filter(Number.isFinite);
    this.low = finite.reduce((a, b) => Math.min(a, b), Infinity);
    this.high = finite.reduce((a, b) => Math.max(a, b), -Infinity);
  }

  draw(time) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const pen = this.canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const { first, last, frames } = this.player;
    const span = this.high - this.low || Math.abs(this.high) || 1;
    const x = (t) => 6 + ((width - 12) * (t - first)) / (last - first || 1);
    const y = (v) => height - 8 - ((height - 30) * (v - this.low)) / span;
    pen.strokeStyle = hydrograd.color("--curve");
    pen.lineWidth = 1.5;
    pen.beginPath();
    let open = false;
    this.values.forEach((value, frame) => {
      if (!Number.isFinite(value)) open = false;
      else if (open) pen.lineTo(x(frames.time[frame]), y(value));
      else {
        pen.moveTo(x(frames.time[frame]), y(value));
        open = true;
      }
    });
    pen.stroke();
    pen.strokeStyle = "#c81e2b";
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(x(time), 18);
    pen.lineTo(x(time), height - 4);
    pen.stroke();
    pen.fillStyle = hydrograd.color("--ink");
    pen.font = "11px system-ui, sans-serif";
    pen.textBaseline = "top";
    const range = Number.isFinite(this.low) ? `${hydrograd.figure(this.low)} … ${hydrograd.figure(this.high)} ${this.unit}` : "none";
    pen.fillText(range, 6, 3);
  }
};

/** A number with four digits. */
hydrograd.figure = (value) => {
  const size = Math.abs(value);
  return size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(2) : String(Number(value.toPrecision(4)));
};
