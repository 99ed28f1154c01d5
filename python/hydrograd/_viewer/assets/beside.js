// Replays beside each other: hands what one tells to the others. `data-status` of the body is "drawn" when all are, or "failed".
"use strict";

(() => {
  const frames = [...document.querySelectorAll("iframe")];
  const statuses = new Map();
  // One is told, and tells the others.
  const go = () => frames[0].contentWindow.postMessage({ go: hydrograd.moment(window.location.hash) }, "*");
  window.addEventListener("message", ({ source, data }) => {
    const from = frames.find((frame) => frame.contentWindow === source);
    if (!from || !data) return;
    if (data.status) {
      statuses.set(from, data.status);
      const all = [...statuses.values()];
      if (all.includes("failed")) document.body.dataset.status = "failed";
      else if (all.length === frames.length) {
        document.body.dataset.status = "drawn";
        go();
      }
    } else if (data.state) {
      document.body.dataset.time = data.state.time;
      for (const frame of frames) if (frame !== from) frame.contentWindow.postMessage(data, "*");
    }
  });
  window.addEventListener("hashchange", go);
})();
