// One of several replays beside each other: what is done to one is done to all, by way of the page around them.
//
// Whoever does something leads from then on, and its clock is everybody's. Each taking of the lead has a number, one above the highest seen: what an older lead still says is passed over, and of two at
// once the first replay's counts.
"use strict";

hydrograd.Link = class {
  /** `place`: which of the replays it is. */
  constructor(player, stage, panel, place) {
    Object.assign(this, { player, stage, panel, place, lead: 0, leader: 0, told: null, acts: false });
    window.addEventListener("message", (event) => {
      if (event.source === window.parent && event.data) this.take(event.data);
    });
  }

  get state() {
    const { time, playing, speed, loop } = this.player;
    const { camera, controls } = this.stage;
    return { time, playing, speed, loop, from: camera.position.toArray(), at: controls.target.toArray() };
  }

  /** Tells of a change, if there is one; called for every picture. */
  tell() {
    const state = this.state;
    const before = this.told;
    const same = before && JSON.stringify(before) === JSON.stringify(state);
    if (same && !this.acts) return;
    this.told = state;
    // What is there at first is nobody's doing.
    if (!before && !this.acts) return;
    const clock = !this.acts && this.leader === this.place && state.playing && this.lasting(before, state);
    if (!clock) {
      [this.lead, this.leader, this.acts] = [this.lead + 1, this.place, false];
      if (this.player.led) Object.assign(this.player, { led: false, clock: null });
    }
    window.parent.postMessage({ state, lead: this.lead, from: this.place }, "*");
  }

  /** Whether only what goes on by itself has changed. */
  lasting(before, state) {
    return ["playing", "speed", "loop"].every((key) => before[key] === state[key]);
  }

  /** Goes where the page around says and leads from there, or does as another did. */
  take({ go, state, lead, from }) {
    const { player, stage } = this;
    // What was done here since the last picture comes first: told, it leads, and what the one before still says is passed over.
    if (state) this.tell();
    if (go) {
      player.jump(go);
      this.acts = true;
    }
    if (!state || lead < this.lead || (lead === this.lead && from > this.leader)) return;
    [this.lead, this.leader] = [lead, from];
    document.getElementById("speed").value = String((player.speed = state.speed));
    document.getElementById("loop").checked = player.loop = state.loop;
    player.led = player.playing = state.playing;
    // The camera goes with that of another.
    this.panel.leave();
    player.seek(state.time);
    stage.camera.position.fromArray(state.from);
    stage.controls.target.fromArray(state.at);
    stage.controls.update();
    this.told = this.state;
  }
};
