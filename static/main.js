// Wires the page together: what a person does goes to teleop, what the robot does goes to the strip.

import { Joystick } from "./joystick.js";
import { Keyboard } from "./keyboard.js";
import { Live } from "./live.js";
import { Scene } from "./scene.js";
import { Shove } from "./shove.js";
import { Status } from "./status.js";
import { Teleop } from "./teleop.js";

const element = (id) => document.getElementById(id);
const teleop = new Teleop();
const status = new Status();
const shove = new Shove({ onPush: (impulse) => teleop.push(impulse) });
let isRunning = true;
let wasLost = false;

async function ask(method, path, body) {
  const options = { method, headers: { "Content-Type": "application/json" }, body: body && JSON.stringify(body) };
  const answer = await fetch(`/api/v1/${path}`, options);
  return answer.json();
}

// A request that fails while the server is away needs no message of its own: the strip says so.
const wish = (method, path, body) => ask(method, path, body).catch(() => status.lost());

const zero = () => wish("PUT", "live/reference", {});
element("zero").addEventListener("click", zero);
element("stop").addEventListener("click", () => wish("POST", isRunning ? "live/pause" : "live/resume"));
element("reset").addEventListener("click", () => wish("POST", "live/reset"));

new Joystick(element("joystick"), { onChange: (x, y) => teleop.set("joystick", { forward: y, left: -x }) });
new Joystick(element("turn"), { isOneAxis: true, onChange: (x) => teleop.set("turn", { turn: -x }) });
const keyboard = new Keyboard({
  onChange: (axes) => teleop.set("keyboard", axes),
  onZero: zero,
  onPush: () => shove.push(),
});
const scene = new Scene({ onLoad: (inner) => keyboard.attach(inner) });

async function learnLimits() {
  const [health, robots] = await Promise.all([ask("GET", "health"), ask("GET", "robots")]);
  const { name, limits } = robots.find((robot) => robot.name === health.robot);
  element("robot").textContent = name === "hrp2" ? "HRP-2" : name[0].toUpperCase() + name.slice(1);
  teleop.limits = limits;
  shove.limit(limits.push);
  const canTurn = limits.yaw_rate[1] > limits.yaw_rate[0];
  element("turn").ariaDisabled = String(!canTurn);
  element("turn").title = canTurn ? "Drag to turn (J, L)" : "This robot does not turn yet";
  element("turn-note").textContent = canTurn ? "" : "turning: not yet";
}

new Live("/api/v1/live/stream?rate=10", {
  silence: 5000,
  onOpen: () => {
    learnLimits().catch(() => status.lost());
    if (wasLost) scene.load(); // viser's own client gives up while its frame has no focus
    wasLost = false;
  },
  onMessage: (live) => {
    isRunning = live.running;
    element("stop").textContent = isRunning ? "Pause" : "Resume";
    status.show(live);
  },
  onLoss: () => {
    wasLost = true;
    status.lost();
  },
});
