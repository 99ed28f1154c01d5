// Starts the replay, and says on the page's body how it went: `data-status` is "drawn" after the first picture, or "failed".
"use strict";

(() => {
  const state = document.body.dataset;
  const fail = (error) => {
    state.status = "failed";
    state.errors = String(Number(state.errors || 0) + 1);
    const note = document.getElementById("note");
    note.textContent = `The replay can't be shown: ${(error && error.message) || error}`;
    note.hidden = false;
    tell();
  };
  // The page around several waits for each.
  const linked = state.place !== "";
  const tell = () => linked && window.parent.postMessage({ status: state.status }, "*");
  window.addEventListener("error", (event) => fail(event.error || event.message));
  try {
    const data = JSON.parse(document.getElementById("data").textContent);
    const stage = new hydrograd.Stage(document.getElementById("stage"), data);
    const player = new hydrograd.Player(data, stage);
    const panel = new hydrograd.Panel(player, stage, data);
    Object.assign(hydrograd, { player, panel, stage });
    document.getElementById("grid").textContent = `grid ${hydrograd.metres(player.cell)}`;

    // `#t=1.5` shows that moment (s), `#t=1.5&play` goes on from there; now, or whenever the address changes.
    const jump = () => player.jump(hydrograd.moment(window.location.hash));
    window.addEventListener("hashchange", jump);
    jump();

    hydrograd.link = linked ? new hydrograd.Link(player, stage, panel, Number(state.place)) : null;
    let drawn = 0;
    const tick = (now) => {
      player.tick(now);
      if (drawn++ === 0) {
        state.frames = player.frames.count;
        state.meshes = player.bodies.meshes;
        state.triangles = stage.renderer.info.render.triangles;
        state.status = state.status || "drawn";
        tell();
      }
      if (hydrograd.link) hydrograd.link.tell();
      state.time = player.time;
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  } catch (error) {
    fail(error);
  }
})();
