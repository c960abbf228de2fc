"use strict";
// Shows an episode that is in the page itself: poses of shapes over time, in metres and seconds, z up.

const data = JSON.parse(document.getElementById("data").textContent);
const canvas = document.getElementById("canvas");
const control = (name) => document.getElementById(name);
const poses = floats(data.poses);    // [frames, moving shapes, x y z w i j k]
const torso = floats(data.torso);    // [frames, x y z]
const moving = data.shapes.filter((shape) => shape.moves);
const still = data.shapes.filter((shape) => !shape.moves);
const COLOURS = { robot: [0.18, 0.44, 0.71], wall: [0.62, 0.58, 0.53], stone: [0.96, 0.75, 0.29],
                  target: [0.82, 0.29, 0.36], way: [0.11, 0.62, 0.47] };

function floats(base64) {
  const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
  const view = new DataView(bytes.buffer), values = new Float32Array(bytes.length / 4);
  for (let i = 0; i < values.length; i++) values[i] = view.getFloat32(4 * i, true);
  return values;
}

// Meshes: triangles as [x, y, z, normal x, y, z] for each corner.

function grid(rings) {
  const corners = [];
  for (let i = 0; i + 1 < rings.length; i++) {
    for (let j = 0; j + 1 < rings[i].length; j++) {
      const [a, b, c, d] = [rings[i][j], rings[i][j + 1], rings[i + 1][j + 1], rings[i + 1][j]];
      corners.push(...a, ...b, ...c, ...a, ...c, ...d);
    }
  }
  return corners;
}

function ring(count, corner) {
  return Array.from({ length: count + 1 }, (_, i) => {
    const angle = 2 * Math.PI * i / count;
    return corner(Math.cos(angle), Math.sin(angle));
  });
}

function rounded([a, b, c], reach) {
  const rings = [];
  for (const side of [-1, 1]) {
    for (let i = 0; i <= 8; i++) {
      const up = Math.PI / 2 * (side < 0 ? i / 8 - 1 : i / 8), across = Math.cos(up), high = Math.sin(up);
      rings.push(ring(24, (x, y) => [a * across * x, b * across * y, c * high + side * reach,
                                     across * x / a, across * y / b, high / c]));
    }
  }
  return grid(rings);
}

function cylinder([a, b, half]) {
  const circle = (z, normal) => ring(32, (x, y) => [a * x, b * y, z, ...normal(x, y)]);
  const point = (z, normal) => ring(32, () => [0, 0, z, ...normal]);
  const cap = (z, normal) => grid([point(z, normal), circle(z, () => normal)]);
  return [...grid([circle(-half, (x, y) => [x, y, 0]), circle(half, (x, y) => [x, y, 0])]),
          ...cap(half, [0, 0, 1]), ...cap(-half, [0, 0, -1])];
}

function box(half) {
  const corners = [];
  for (let axis = 0; axis < 3; axis++) {
    for (const side of [-1, 1]) {
      const corner = (u, v) => {
        const place = [0, 0, 0], normal = [0, 0, 0];
        place[axis] = side * half[axis];
        place[(axis + 1) % 3] = u * half[(axis + 1) % 3];
        place[(axis + 2) % 3] = v * half[(axis + 2) % 3];
        normal[axis] = side;
        return [...place, ...normal];
      };
      corners.push(...grid([[corner(-1, -1), corner(1, -1)], [corner(-1, 1), corner(1, 1)]]));
    }
  }
  return corners;
}

const MESHES = { sphere: (s) => rounded(s.radii, 0), ellipsoid: (s) => rounded(s.radii, 0),
                 capsule: (s) => rounded(s.radii, s.reach), cylinder: (s) => cylinder(s.radii),
                 box: (s) => box(s.radii) };

function wayMesh() {
  const corners = [], width = 0.02;
  for (let i = 0; i + 1 < data.frames; i++) {
    const [x, y, z, u, v, w] = torso.subarray(3 * i, 3 * i + 6);
    const length = Math.hypot(u - x, v - y);
    if (length === 0) continue;
    const across = width * (y - v) / length, along = width * (u - x) / length, up = [0, 0, 1];
    const a = [x + across, y + along, z, ...up], b = [x - across, y - along, z, ...up];
    const c = [u - across, v - along, w, ...up], d = [u + across, v + along, w, ...up];
    corners.push(...a, ...b, ...c, ...a, ...c, ...d);
    if (Math.abs(w - z) > 0.001) {  // a ribbon that rises is seen from the side as well
      corners.push(x, y, z - width, ...up, x, y, z + width, ...up, u, v, w + width, ...up);
      corners.push(x, y, z - width, ...up, u, v, w + width, ...up, u, v, w - width, ...up);
    }
  }
  return corners;
}

// The picture.

const gl = canvas.getContext("webgl", { antialias: true });
if (!gl) {
  const problem = document.createElement("p");
  problem.id = "problem";
  problem.textContent = "This browser shows no WebGL, which the picture needs.";
  canvas.replaceWith(problem);
  throw new Error("no WebGL");
}

const VERTEX = `
  attribute vec3 corner, normal;
  uniform mat4 camera; uniform vec3 place; uniform mat3 turn;
  varying vec3 world, facing, own;
  void main() {
    world = turn * corner + place; facing = turn * normal; own = normalize(normal);
    gl_Position = camera * vec4(world, 1.0);
  }`;
const FRAGMENT = `
  precision highp float;
  uniform vec3 colour, eye; uniform float kind;  // 0: plain, 1: floor, 2: sphere with a spot where its x axis points
  varying vec3 world, facing, own;
  void main() {
    vec3 n = normalize(facing);
    float light = 0.62 + 0.28 * max(dot(n, normalize(vec3(-0.4, -0.5, 0.8))), 0.0) + 0.10 * n.z;
    vec3 base = colour;
    if (kind == 1.0) {
      vec2 cell = floor(world.xy);
      base = mix(vec3(0.80, 0.83, 0.86), vec3(0.88, 0.90, 0.92), mod(cell.x + cell.y, 2.0));
    }
    if (kind == 2.0 && own.x > 0.88) base = vec3(0.95);
    float far = kind == 1.0 ? clamp(distance(eye, world) / 60.0, 0.0, 1.0) : 0.0;
    gl_FragColor = vec4(mix(base * light, vec3(0.93, 0.945, 0.957), far), 1.0);
  }`;

function compiled(type, source) {
  const shader = gl.createShader(type);
  gl.shaderSource(shader, source);
  gl.compileShader(shader);
  if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
  return shader;
}

const program = gl.createProgram();
gl.attachShader(program, compiled(gl.VERTEX_SHADER, VERTEX));
gl.attachShader(program, compiled(gl.FRAGMENT_SHADER, FRAGMENT));
gl.linkProgram(program);
if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
gl.useProgram(program);
gl.enable(gl.DEPTH_TEST);
gl.clearColor(0.93, 0.945, 0.957, 1);
const at = Object.fromEntries(["camera", "place", "turn", "colour", "eye", "kind"].map(
  (name) => [name, gl.getUniformLocation(program, name)]));
const slots = [gl.getAttribLocation(program, "corner"), gl.getAttribLocation(program, "normal")];
slots.forEach((slot) => gl.enableVertexAttribArray(slot));
const SAME = [1, 0, 0, 0, 1, 0, 0, 0, 1];

function upload(corners) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners), gl.STATIC_DRAW);
  return { buffer, count: corners.length / 6 };
}

const meshes = new Map();
function meshOf(shape) {
  const name = JSON.stringify([shape.kind, shape.radii, shape.reach]);
  if (!meshes.has(name)) meshes.set(name, upload(MESHES[shape.kind](shape)));
  return meshes.get(name);
}

const [cx, cy] = data.view.target, FAR = 500;
const floor = upload(grid([[[cx - FAR, cy - FAR, 0, 0, 0, 1], [cx + FAR, cy - FAR, 0, 0, 0, 1]],
                           [[cx - FAR, cy + FAR, 0, 0, 0, 1], [cx + FAR, cy + FAR, 0, 0, 0, 1]]]));
const way = upload(wayMesh());
const discs = data.marks.map((mark) => upload(cylinder([mark.within, mark.within, 0.006])));
const labels = data.marks.map((mark) => {
  const label = document.createElement("div");
  label.className = "label";
  label.textContent = mark.text;
  canvas.parentElement.append(label);
  return label;
});

function show(mesh, colour, place = [0, 0, 0], turn = SAME, kind = 0) {
  gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffer);
  slots.forEach((slot, i) => gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 24, 12 * i));
  gl.uniform3fv(at.colour, colour);
  gl.uniform3fv(at.place, place);
  gl.uniformMatrix3fv(at.turn, false, turn);
  gl.uniform1f(at.kind, kind);
  gl.drawArrays(gl.TRIANGLES, 0, mesh.count);
}

function rotation([w, x, y, z]) {  // columns one after the other
  return [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y),
          2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
          2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
}

// The camera turns around a target.

let view, frame = 0, playing = false, plays = 0, clock = 0, asked = false;

function resetView() {
  view = { ...data.view, target: [...data.view.target] };
  control("follow").checked = data.view.follow;
}

function axes() {
  const [a, e] = [view.azimuth, view.elevation];
  const back = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
  const right = [-Math.sin(a), Math.cos(a), 0];
  const up = [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)];
  return { back, right, up };
}

const dot = (p, q) => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];

function camera(width, height) {
  const { back, right, up } = axes();
  const eye = view.target.map((value, i) => value + view.distance * back[i]);
  const near = view.distance / 50, far = view.distance + 400, f = 2.2 * Math.min(1, width / height);
  const rows = [right.map((v) => v * f * height / width), up.map((v) => v * f), back];
  const [px, py, pz] = rows.map((row) => -dot(row, eye));
  const k = (far + near) / (near - far), m = 2 * far * near / (near - far);
  const matrix = [];
  for (let i = 0; i < 3; i++) matrix.push(rows[0][i], rows[1][i], k * rows[2][i], -rows[2][i]);
  matrix.push(px, py, k * pz + m, -pz);
  return { matrix, eye };
}

function render() {
  asked = false;
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  if (control("follow").checked) view.target = [...torso.subarray(3 * frame, 3 * frame + 3)];
  const { matrix, eye } = camera(width, height);
  gl.uniformMatrix4fv(at.camera, false, matrix);
  gl.uniform3fv(at.eye, eye);
  show(floor, [1, 1, 1], [0, 0, 0], SAME, 1);
  data.marks.forEach((mark, i) => show(discs[i], COLOURS[mark.target ? "target" : "stone"], [...mark.place, 0.006]));
  still.forEach((shape) => show(meshOf(shape), COLOURS.wall, shape.pose.slice(0, 3), rotation(shape.pose.slice(3))));
  if (way.count) show(way, COLOURS.way);
  moving.forEach((shape, i) => {
    const pose = poses.subarray(7 * (frame * moving.length + i), 7 * (frame * moving.length + i) + 7);
    const kind = shape.kind === "sphere" ? 2 : 0;
    show(meshOf(shape), COLOURS.robot, pose.subarray(0, 3), rotation(pose.subarray(3)), kind);
  });
  data.marks.forEach((mark, i) => {
    const p = [...mark.place, 0.03, 1];
    const [x, y, , w] = [0, 1, 2, 3].map((row) => p.reduce((sum, v, j) => sum + matrix[4 * j + row] * v, 0));
    labels[i].hidden = w <= 0 || mark.text === "";
    labels[i].style.left = `${width * (1 + x / w) / 2}px`;
    labels[i].style.top = `${height * (1 - y / w) / 2}px`;
  });
  const seconds = (steps) => (steps * data.seconds).toFixed(1);
  control("time").textContent =
    `${seconds(frame + 1)} of ${seconds(data.frames)} s, step ${frame + 1} of ${data.frames}`;
  control("scrub").value = frame;
}

function redraw() {
  if (!asked) { asked = true; requestAnimationFrame(render); }
}

function go(to) {
  frame = Math.min(Math.max(to, 0), data.frames - 1);
  clock = frame * data.seconds;
  redraw();
}

function play(on) {
  if (on && frame === data.frames - 1) go(0);
  playing = on;
  control("play").textContent = on ? "Pause" : "Play";
  if (on) {
    const mine = ++plays;  // a pause and a play within one picture must not leave two of these running
    let last = performance.now();
    const tick = (now) => {
      if (!playing || mine !== plays) return;
      clock += Math.max(now - last, 0) / 1000 * Number(control("speed").value);
      last = now;
      frame = Math.min(Math.floor(clock / data.seconds), data.frames - 1);
      render();
      if (frame === data.frames - 1) play(false); else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
}

// Mouse, touch, keys.

function turnBy(x, y) {
  view.azimuth -= 0.008 * x;
  view.elevation = Math.min(Math.max(view.elevation + 0.008 * y, 0.03), Math.PI / 2);
}

function moveBy(x, y) {
  const { right, up } = axes(), step = view.distance / (1.1 * canvas.clientHeight);
  view.target = view.target.map((value, i) => value - step * x * right[i] + step * y * up[i]);
  control("follow").checked = false;
}

const zoomBy = (factor) => { view.distance = Math.min(Math.max(view.distance * factor, 0.3), 200); };

const fingers = new Map();
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
});
canvas.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const now = [event.clientX, event.clientY], x = now[0] - before[0], y = now[1] - before[1];
  if (fingers.size === 1) {
    if (event.shiftKey || event.buttons & 2) moveBy(x, y); else turnBy(x, y);
  } else if (fingers.size === 2) {
    const [other] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    const apart = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]);
    zoomBy(Math.max(apart(before), 1) / Math.max(apart(now), 1));
    moveBy(x / 2, y / 2);
  }
  fingers.set(event.pointerId, now);
  redraw();
});
for (const end of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
}
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoomBy(Math.exp(Math.sign(event.deltaY) * 0.12));
  redraw();
}, { passive: false });

function speedBy(steps) {
  const speed = control("speed");
  speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + steps, 0), speed.options.length - 1);
}

function stepBy(frames) {
  play(false);
  go(frame + frames);
}

const KEYS = { " ": () => play(!playing), ArrowLeft: () => stepBy(-1), ArrowRight: () => stepBy(1),
               Home: () => stepBy(-data.frames), End: () => stepBy(data.frames),
               a: () => turnBy(12, 0), d: () => turnBy(-12, 0), w: () => turnBy(0, 12), s: () => turnBy(0, -12),
               "+": () => zoomBy(1 / 1.12), "-": () => zoomBy(1.12), "[": () => speedBy(-1), "]": () => speedBy(1),
               f: () => control("follow").click(), r: () => control("reset").click() };
document.addEventListener("keydown", (event) => {
  const action = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
  // Fields and buttons keep the keys that are theirs.
  if (event.target.matches("select") || (event.key === " " && event.target.matches("button, input[type=checkbox]"))) return;
  event.preventDefault();
  action();
  redraw();
});
control("play").addEventListener("click", () => play(!playing));
control("scrub").max = data.frames - 1;
control("scrub").addEventListener("input", () => { play(false); go(Number(control("scrub").value)); });
control("follow").addEventListener("change", redraw);
control("reset").addEventListener("click", () => { resetView(); redraw(); });
window.addEventListener("resize", redraw);
resetView();
render();
