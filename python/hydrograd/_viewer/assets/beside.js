// Replays beside each other: hands what one tells to the others. `data-status` of the body is "drawn" when all are, or "failed".
"use strict";

(() => {
  const frames = [...document.querySelectorAll("iframe")];
  const statuses = new Map();
  let leader = null;
  // One is told, and tells the others.
  const go = () => {
    const able = frames.filter((frame) => statuses.get(frame) === "drawn");
    const first = able.includes(leader) ? leader : able[0];
    if (first) first.contentWindow.postMessage({ go: hydrograd.moment(window.location.hash) }, "*");
  };
  window.addEventListener("message", ({ source, data }) => {
    const from = frames.find((frame) => frame.contentWindow === source);
    if (!from || !data) return;
    if (data.status) {
      statuses.set(from, data.status);
      if (statuses.size < frames.length) return;
      document.body.dataset.status = [...statuses.values()].includes("failed") ? "failed" : "drawn";
      go();
    } else if (data.state) {
      leader = from;
      document.body.dataset.time = data.state.time;
      for (const frame of frames) if (frame !== from) frame.contentWindow.postMessage(data, "*");
    }
  });
  window.addEventListener("hashchange", go);
})();
