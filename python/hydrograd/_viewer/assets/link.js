// One of several replays beside each other: what is done to one is done to all, by way of the page around them.
"use strict";

hydrograd.Link = class {
  constructor(player, stage) {
    [this.player, this.stage] = [player, stage];
    this.told = null;
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
    if (before && JSON.stringify(before) === JSON.stringify(state)) return;
    this.told = state;
    // What is there at first is nobody's doing.
    if (!before) return;
    const same = ["playing", "speed", "loop"].every((key) => before[key] === state[key]);
    const clock = state.playing && !this.player.led && same;
    // Who does something leads from then on.
    if (!clock && this.player.led) Object.assign(this.player, { led: false, clock: null });
    window.parent.postMessage({ state, clock }, "*");
  }

  /** Goes where the page around says, or does as another did. */
  take({ go, state, clock }) {
    const { player, stage } = this;
    if (go) player.jump(go);
    // A clock that was stopped here may not have heard of it yet.
    if (!state || (clock && !player.led)) return;
    stage.camera.position.fromArray(state.from);
    stage.controls.target.fromArray(state.at);
    stage.controls.update();
    document.getElementById("speed").value = String((player.speed = state.speed));
    document.getElementById("loop").checked = player.loop = state.loop;
    player.led = player.playing = state.playing;
    player.seek(state.time);
    this.told = this.state;
  }
};
