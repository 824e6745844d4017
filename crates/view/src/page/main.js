const canvas = element("canvas");
const status = element("status");

function failed(error) {
  status.textContent = `Nothing can be shown: ${error.message}`;
  document.body.dataset.state = "failed";
}

const state = { frame: 0, playing: meta.frames > 1, dirty: true, wipe: 0.5, passed: 0 };
const camera = new Camera();

function fill(select, chosen) {
  for (const [name, title] of choices) {
    const option = new Option(title, name, false, name === chosen);
    select.add(option);
  }
}
fill(element("choice-a"), "average");
fill(element("choice-b"), "gram-schmidt");
element("frame").max = meta.frames - 1;

// Controls as the address asks for them, by their ids: #mode=side&choice-b=dual&frame=12&mark=true&turn=0.5
function fromAddress() {
  const asked = new URLSearchParams(location.hash.slice(1));
  for (const [id, value] of asked) {
    const control = element(id);
    if (id === "turn" || id === "tilt") camera[id] = Number(value) || 0;
    else if (control && control.type === "checkbox") control.checked = value === "true";
    else if (control && control.form && "value" in control && control.type !== "button") control.value = value;
  }
  if (asked.has("frame")) {
    state.frame = Number(element("frame").value);
    state.playing = false;
  }
  camera.update();
}
fromAddress();

const number = (id, least, most, otherwise) => {
  const value = Number(element(id).value);
  return Number.isFinite(value) && element(id).value !== "" ? Math.min(Math.max(value, least), most) : otherwise;
};

function settings(side) {
  const choice = choices.find(([name]) => name === element(`choice-${side}`).value);
  return { choice: choice[2], title: choice[1], turned: element(`turned-${side}`).checked, steps: Math.round(number("steps", 0, 100, 15)), eye: camera.eye };
}

function label(side, shown) {
  const { title, turned } = settings(side);
  element(`label-${side}`).textContent = shown ? `${title}${turned ? "" : ", SH not turned"}` : "";
}

function start() {
  const gl = openGl(canvas);
  const skinner = new Skinner(gl);
  const drawer = new Drawer(gl);
  const order = new Order();
  const targets = [skinner.target(), skinner.target()];
  if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE) throw new Error("this graphics driver draws into too few textures at once");

  function resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
      state.dirty = true;
    }
  }

  function draw() {
    const { width, height } = canvas;
    const mode = element("mode").value;
    const limit = element("mark").checked ? number("limit", 0.1, 180, 10) : 0;
    const light = element("light").checked;
    const both = mode !== "one";
    if (element("follow").checked) camera.follow(state.frame);
    skinner.useFrame(state.frame);
    const sides = both ? ["a", "b"] : ["a"];
    const dual = sides.map((side) => settings(side).choice === DUAL);
    sides.forEach((side, k) => skinner.pose(targets[k], settings(side)));
    let sorted = null;
    // Dual quaternions move means elsewhere, so they have an order of their own.
    const drawn = (frame, k, area, only) => {
      if (sorted !== dual[k]) drawer.useOrder(order.sorted(state.frame, camera.direction, dual[k]));
      sorted = dual[k];
      drawer.draw(frame, targets[k], camera, area, only, limit);
    };
    const all = [0, 0, width, height];
    const half = Math.round(width / 2);
    const pictures = (mode === "difference" ? [0, 1] : [0]).map((k) => drawer.picture(k, width, height));
    pictures.forEach(({ frame }) => drawer.clear(frame, width, height, light));
    const into = pictures[0].frame;
    if (mode === "difference") {
      pictures.forEach(({ frame }, k) => drawn(frame, k, all, all));
    } else if (mode === "side") {
      [0, 1].forEach((k) => {
        const area = [k * half, 0, k ? width - half : half, height];
        drawn(into, k, area, area);
      });
    } else if (mode === "wipe") {
      const at = Math.round(state.wipe * width);
      drawn(into, 0, all, [0, 0, at, height]);
      drawn(into, 1, all, [at, 0, width - at, height]);
    } else {
      drawn(into, 0, all, all);
    }
    drawer.show(pictures, width, height);
    label("a", true);
    label("b", both);
    element("frame").value = state.frame;
    element("frame-number").textContent = state.frame;
  }

  function summary(degrees) {
    degrees.sort();
    const off = degrees.findIndex((d) => d > 1);
    const share = off < 0 ? 0 : (100 * (degrees.length - off)) / degrees.length;
    return `${share.toFixed(1)} % of the Gaussians off the average by more than 1°, at most ${degrees[degrees.length - 1].toFixed(1)}°`;
  }

  // What was asked for arrives some pictures later, so that drawing does not wait for it.
  let asked = null;
  function ask() {
    const sides = element("mode").value === "one" ? ["A"] : ["A", "B"];
    asked = { frame: state.frame, sides, readings: sides.map((_, k) => skinner.ask(targets[k])) };
  }
  function hear() {
    if (!asked || !asked.readings.every((reading) => skinner.isThere(reading))) return;
    const lines = asked.sides.map((side, k) => `${side}: ${summary(skinner.degrees(asked.readings[k]))}`);
    element("numbers").textContent = `Frame ${asked.frame}. ${lines.join(". ")}.`;
    asked = null;
    document.body.dataset.said = Number(document.body.dataset.said || 0) + 1;
  }

  let before = performance.now();
  let drawn = 0;
  let counted = before;
  let said = 0;
  let wanted = false;
  function step(now) {
    resize();
    if (state.playing) {
      state.passed += ((now - before) / 1000) * meta.framerate * Number(element("speed").value);
      const frames = Math.floor(state.passed);
      if (frames > 0) {
        state.passed -= frames;
        state.frame = (state.frame + frames) % meta.frames;
        state.dirty = true;
      }
    }
    before = now;
    if (state.dirty) {
      state.dirty = false;
      draw();
      drawn++;
      document.body.dataset.drawn = Number(document.body.dataset.drawn || 0) + 1;
      wanted = true;
    }
    hear();
    if (wanted && !asked && (!state.playing || now - said > 500)) {
      wanted = false;
      said = now;
      ask();
    }
    if (now - counted > 1000) {
      const rate = (1000 * drawn) / (now - counted);
      status.textContent = `${meta.count.toLocaleString("en")} Gaussians, ${meta.joints} joints, ${meta.frames} frames; ${drawn ? `${rate.toFixed(rate < 10 ? 1 : 0)} pictures per second` : "still"}`;
      drawn = 0;
      counted = now;
    }
    requestAnimationFrame(step);
  }
  status.textContent = `${meta.count.toLocaleString("en")} Gaussians`;
  document.body.dataset.state = "ready";
  requestAnimationFrame(step);
}

function play(on) {
  state.playing = on && meta.frames > 1;
  element("play").textContent = state.playing ? "Pause" : "Play";
  element("play").setAttribute("aria-pressed", String(state.playing));
  state.dirty = true;
}
play(state.playing);

element("play").addEventListener("click", () => play(!state.playing));
element("frame").addEventListener("input", () => {
  play(false);
  state.frame = Number(element("frame").value);
});
element("controls").addEventListener("input", () => (state.dirty = true));
element("controls").addEventListener("submit", (event) => event.preventDefault());
element("reset").addEventListener("click", () => {
  camera.reset();
  state.wipe = 0.5;
  state.dirty = true;
});

const pointers = new Map();
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, event);
});
for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  const last = pointers.get(event.pointerId);
  if (!last) {
    if (element("mode").value === "wipe" && event.pointerType === "mouse") wipeTo(event);
    return;
  }
  const [dx, dy] = [event.clientX - last.clientX, event.clientY - last.clientY];
  const others = [...pointers.values()].filter((other) => other.pointerId !== event.pointerId);
  pointers.set(event.pointerId, event);
  if (others.length === 1) {
    // Two fingers: the distance between them zooms, their middle shifts.
    const apart = (a) => Math.hypot(a.clientX - others[0].clientX, a.clientY - others[0].clientY);
    camera.zoom(Math.max(apart(last), 1) / Math.max(apart(event), 1));
    camera.shift(dx / 2, dy / 2, canvas.clientHeight);
  } else if (event.shiftKey || event.buttons === 2) {
    camera.shift(dx, dy, canvas.clientHeight);
  } else {
    camera.orbit(dx * 0.01, dy * 0.01);
  }
  state.dirty = true;
});
function wipeTo(event) {
  const box = canvas.getBoundingClientRect();
  state.wipe = (event.clientX - box.left) / box.width;
  state.dirty = true;
}
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener(
  "wheel",
  (event) => {
    event.preventDefault();
    camera.zoom(Math.exp(Math.sign(event.deltaY) * 0.1));
    state.dirty = true;
  },
  { passive: false },
);
canvas.addEventListener("keydown", (event) => {
  const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const move = moves[event.key];
  if (move && event.shiftKey) camera.shift(20 * move[0], 20 * move[1], canvas.clientHeight);
  else if (move) camera.orbit(0.1 * move[0], 0.1 * move[1]);
  else if (event.key === "+" || event.key === "=") camera.zoom(0.9);
  else if (event.key === "-") camera.zoom(1 / 0.9);
  else if (event.key === "[") state.wipe = Math.max(0, state.wipe - 0.05);
  else if (event.key === "]") state.wipe = Math.min(1, state.wipe + 0.05);
  else if (event.key === " ") play(!state.playing);
  else if (event.key === "," || event.key === ".") {
    play(false);
    state.frame = (state.frame + (event.key === "." ? 1 : meta.frames - 1)) % meta.frames;
  } else return;
  event.preventDefault();
  state.dirty = true;
});

canvas.addEventListener("webglcontextlost", () => failed(new Error("the graphics driver stopped; reload the page")));

try {
  start();
} catch (error) {
  failed(error);
}
