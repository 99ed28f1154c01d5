// Buttons, sliders and keys.
"use strict";

hydrograd.Panel = class {
  constructor(player, stage, data) {
    this.get = (id) => document.getElementById(id);
    this.player = player;
    this.stage = stage;
    this.data = data;
    this.buttons();
    this.switches();
    this.scales();
    this.legend();
    this.curves();
    this.keys();
    // On a narrow page the picture comes first.
    if (window.innerWidth <= 560) document.querySelector("aside details").open = false;
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      stage.ask();
      this.plot.draw(player.time);
    });
    player.listen(() => this.show());
  }

  on(id, event, action) {
    this.get(id).addEventListener(event, action);
  }

  buttons() {
    const { player, stage } = this;
    const scrub = this.get("scrub");
    scrub.max = player.last - player.first;
    this.on("play", "click", () => (player.playing ? player.pause() : player.play()));
    this.on("back", "click", () => player.step(-1));
    this.on("on", "click", () => player.step(1));
    this.on("scrub", "input", () => {
      const time = player.first + Number(scrub.value); // before pausing writes to it
      player.pause();
      player.seek(time);
    });
    this.on("speed", "change", (event) => (player.speed = Number(event.target.value)));
    this.on("loop", "change", (event) => (player.loop = event.target.checked));
    this.on("reset", "click", () => this.reset());
    this.on("save", "click", () => this.save());
    for (const [id, axis] of [["look-x", [1, 0, 0]], ["look-y", [0, -1, 0]], ["look-z", [0, 0, 1]]]) {
      this.on(id, "click", () => this.reset(new THREE.Vector3(...axis)));
    }
    this.on("follow", "change", (event) => player.follow(Number(event.target.value)));
  }

  /** The picture as a file, called after the scene and the time. */
  save() {
    this.stage.picture().toBlob((blob) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob);
      link.download = `${document.title || "replay"} ${this.player.time.toFixed(3)} s.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }

  reset(direction = this.stage.direction) {
    this.leave();
    this.stage.look(direction);
  }

  /** Follows nothing. */
  leave() {
    this.get("follow").value = "-1";
    this.player.follow(-1);
  }

  switches() {
    const { player, stage } = this;
    const of = (id, action) => {
      const set = () => {
        action(this.get(id).checked);
        stage.ask();
      };
      this.on(id, "change", set);
      set();
    };
    const touching = () =>
      player.contacts.arrows.visible({ arrows: this.get("forces").checked, dots: this.get("points").checked });
    of("forces", touching);
    of("points", touching);
    of("flow", (shown) => player.flow && player.flow.arrows.visible({ arrows: shown }));
    of("trails", (shown) => player.bodies.trails(shown));
    of("edges", (shown) => player.bodies.edges(shown));
    of("glass", (seen) => player.bodies.glass(seen));
    for (const part of document.querySelectorAll(".contact")) part.hidden = !player.contacts.any;
    this.get("flow").parentElement.hidden = !player.flow;
    of("lines", (shown) => player.streamlines && player.streamlines.visible(shown));
    this.get("lines").parentElement.hidden = !player.streamlines;
    of("loads", (shown) => player.forces && player.forces.arrows.visible({ arrows: shown }));
    of("torques", (shown) => player.torques && player.torques.visible(shown));
    for (const id of ["loads", "torques"]) this.get(id).parentElement.hidden = !player.forces;
    const pressed = player.pressure && player.pressure.any;
    this.get("pressure").parentElement.hidden = !pressed;
    if (pressed) {
      this.get("pressure").nextSibling.textContent = player.pressure.name;
      player.pressure.legend(this.get("pressures"));
    }
    of("pressure", (shown) => {
      if (player.pressure) player.pressure.show(shown);
      this.get("pressures").hidden = !pressed || !shown;
    });
  }

  /** How much the largest arrows stand for, which are as long at all moments. */
  scales() {
    const { flow, forces, torques, streamlines } = this.player;
    const { figure, metres } = hydrograd;
    const lines = [];
    if (forces && forces.largest > 0) lines.push(`longest violet arrow ${figure(forces.largest)} N`);
    if (torques && torques.largest > 0) lines.push(`widest orange arc ${figure(torques.largest)} N m`);
    if (flow && flow.scale > 0) lines.push(`blue arrow of ${metres(flow.longest)} ${figure(flow.longest / flow.scale)} m/s`);
    if (streamlines && streamlines.fastest > 0) lines.push(`darkest line ${figure(streamlines.fastest)} m/s`);
    this.lines("scales", lines);
    const pressed = this.player.pressure && this.player.pressure.any;
    this.get("legend").hidden = lines.length === 0 && !pressed;
  }

  /** Puts lines of text into an element. */
  lines(id, texts) {
    this.get(id).replaceChildren(...texts.map((textContent) => Object.assign(document.createElement("div"), { textContent })));
  }

  /** A line for each body: shown or not, and whom the camera may follow. */
  legend() {
    this.data.bodies.forEach((body, number) => {
      const label = document.createElement("label");
      const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true });
      box.addEventListener("change", () => {
        this.player.bodies.show(number, box.checked);
        this.stage.ask();
      });
      const chip = document.createElement("i");
      chip.style.background = body.color;
      label.append(box, chip, body.name);
      this.get("bodies").append(label);
      this.get("follow").append(new Option(body.name, String(number)));
    });
  }

  curves() {
    const { player, data } = this;
    this.plot = new hydrograd.Plot(this.get("plot"), player, (time) => {
      player.pause();
      player.seek(time);
    });
    this.series = data.series.map(({ name, unit, values }) => ({ name, unit, values: hydrograd.decode(values) }));
    this.series.forEach(({ name, unit }, number) => this.get("curve").append(new Option(`${name}, ${unit}`, number)));
    const take = () => {
      const { values, unit } = this.series[Number(this.get("curve").value)];
      this.plot.take(values, unit);
      this.plot.draw(player.time);
    };
    this.on("curve", "change", take);
    new ResizeObserver(() => this.plot.draw(player.time)).observe(this.get("plot"));
    take();
  }

  keys() {
    const { player } = this;
    const actions = {
      " ": () => (player.playing ? player.pause() : player.play()),
      ArrowLeft: () => player.step(-1),
      ArrowRight: () => player.step(1),
      Home: () => player.seek(player.first),
      End: () => player.seek(player.last),
      r: () => this.reset(),
      p: () => this.save(),
    };
    window.addEventListener("keydown", (event) => {
      // What has the focus takes its own keys: lists and sliders all of these, buttons and boxes the space bar.
      const { tagName, type } = event.target;
      const taken = tagName === "SELECT" || type === "range" || (["BUTTON", "INPUT"].includes(tagName) && event.key === " ");
      if (taken || event.ctrlKey || event.metaKey || event.altKey || !actions[event.key]) return;
      event.preventDefault();
      actions[event.key]();
    });
  }

  show() {
    const { player } = this;
    this.get("play").textContent = player.playing ? "❚❚" : "▶";
    this.get("play").title = player.playing ? "pause (space)" : "play (space)";
    this.get("scrub").value = player.time - player.first;
    this.get("time").textContent = `${player.time.toFixed(3)} s, step ${player.frames.steps[player.frame]}`;
    const facts = this.series.map(({ name, unit, values }) => {
      const value = values[player.frame];
      return Number.isFinite(value) ? `${name} ${hydrograd.figure(value)} ${unit}` : null;
    });
    if (player.contacts.any) {
      const { count, largest } = player.touching;
      facts.push(count ? `contacts ${count}, up to ${hydrograd.figure(largest)} N` : "contacts 0");
    }
    if (player.flow) facts.push(`flow up to ${hydrograd.figure(player.fastest)} m/s`);
    if (player.streamlines) facts.push(`streamlines ${player.lines}`);
    if (player.forces) facts.push(`force of the flow up to ${hydrograd.figure(player.strongest)} N`, `torque up to ${hydrograd.figure(player.hardest)} N m`);
    if (player.pressure && player.pressure.any) facts.push(`pressure ${[...player.pressed].map(hydrograd.figure).join(" … ")} Pa`);
    this.lines("facts", facts.filter(Boolean));
    this.plot.draw(player.time);
  }
};
