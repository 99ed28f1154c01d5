// The clock, and everything that shows one moment.
"use strict";

hydrograd.Player = class {
  constructor(data, stage) {
    this.data = data;
    this.stage = stage;
    this.frames = new hydrograd.Frames(data);
    this.cell = hydrograd.addWalls(data, stage);
    this.bodies = new hydrograd.Bodies(data, this.frames, stage);
    this.contacts = new hydrograd.Contacts(data, stage);
    this.flow = data.flow ? new hydrograd.Flow(data, stage) : null;
    this.forces = data.forces ? new hydrograd.Forces(data, this.bodies.groups, stage) : null;
    this.torques = data.forces ? new hydrograd.Torques(data, this.bodies.groups, stage) : null;
    this.streamlines = data.streamlines ? new hydrograd.Streamlines(data, stage) : null;
    this.pressure = data.pressure ? new hydrograd.Pressure(data.pressure, this.bodies.groups) : null;
    this.followed = -1;
    this.speed = 1;
    this.loop = false;
    this.playing = false;
    this.led = false; // by the clock of another replay
    [this.first, this.last] = data.range; // s
    this.time = this.first;
    this.listeners = [];
    this.seek(this.time);
  }

  /** Calls back whenever another moment is shown. */
  listen(listener) {
    this.listeners.push(listener);
    listener(this);
  }

  seek(time) {
    const { first, last } = this;
    this.time = Math.min(Math.max(Number.isFinite(time) ? time : first, first), last);
    const before = this.followed < 0 ? null : this.bodies.middle(this.followed);
    const at = this.frames.locate(this.time);
    this.frame = at.frame;
    this.bodies.place(at);
    this.touching = this.contacts.place(at.frame);
    this.fastest = this.flow ? this.flow.place(at.frame) : 0;
    this.strongest = this.forces ? this.forces.place(at.frame) : 0;
    this.hardest = this.torques ? this.torques.place(at.frame) : 0;
    this.lines = this.streamlines ? this.streamlines.place(at.frame) : 0;
    this.pressed = this.pressure ? this.pressure.place(at.frame) : null;
    if (before) this.stage.shift(this.bodies.middle(this.followed).sub(before));
    this.stage.ask();
    this.listeners.forEach((listener) => listener(this));
  }

  /** Goes some frames on, or back. */
  step(frames) {
    this.pause();
    const { frame, share } = this.frames.locate(this.time);
    // Between two frames, and beyond the last, that before is one back already.
    const between = share > 0 || this.time > this.frames.last;
    const to = frame + frames + (frames < 0 && between ? 1 : 0);
    if (to >= 0 && to < this.frames.count) this.seek(this.frames.time[to]);
  }

  follow(body) {
    this.followed = body;
    if (body >= 0) this.stage.shift(this.bodies.middle(body).sub(this.stage.controls.target));
  }

  play() {
    if (this.time >= this.last) this.seek(this.first);
    this.playing = this.last > this.first;
    this.led = false;
    this.clock = null;
    this.listeners.forEach((listener) => listener(this));
  }

  /** To a moment (s), if one is given, and on from there or not. */
  jump({ time, play }) {
    if (time !== undefined) {
      this.pause();
      this.seek(time);
    }
    if (play) this.play();
  }

  pause() {
    this.playing = this.led = false;
    this.listeners.forEach((listener) => listener(this));
  }

  /** Called for every picture of the browser, with its time in ms. */
  tick(now) {
    if (this.playing && !this.led) {
      const passed = this.clock === null ? 0 : (now - this.clock) / 1000;
      this.clock = now;
      const next = this.time + this.speed * passed;
      this.seek(next);
      if (next >= this.last) {
        if (this.loop) this.seek(this.first);
        else this.pause();
      }
    }
    if (this.stage.wanted) this.stage.draw();
  }
};
