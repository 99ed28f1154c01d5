// Pictures for a video: each moment is asked for, and what only a hand could use is out of sight.
"use strict";

/** Makes the page ready for pictures: with its panel or without, the camera so many times nearer, and along with a body of this name if there is one. */
hydrograd.pose = ({ panel, zoom, follow }) => {
  const { player, stage } = hydrograd;
  // Of several beside each other each is asked by itself.
  hydrograd.link = null;
  document.body.classList.add("video");
  document.body.classList.toggle("panel", panel);
  document.querySelector("aside details").open = true;
  document.querySelector("aside").hidden = !panel && document.getElementById("legend").hidden;
  const body = player.data.bodies.findIndex(({ name }) => name === follow);
  if (follow !== null && body >= 0) player.follow(body);
  const { camera, controls } = stage;
  camera.position.sub(controls.target).divideScalar(zoom).add(controls.target);
  controls.update();
  stage.resize();
};

/** Draws a moment, s. */
hydrograd.shoot = (time) => {
  hydrograd.player.seek(time);
  hydrograd.stage.draw();
};
