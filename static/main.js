// Wires the page together: what a person does goes to the server, what the robot does comes back to the page.

import { GamepadDialog } from "./gamepad_dialog.js";
import { Gamepads } from "./gamepad.js";
import { Helm } from "./helm.js";
import { Joystick } from "./joystick.js";
import { Keyboard } from "./keyboard.js";
import { Live } from "./live.js";
import { chooseLook, chosenLook } from "./look.js";
import { notify } from "./notices.js";
import { PushReport } from "./push_report.js";
import { RandomPushes } from "./random_pushes.js";
import { Unreachable, ask } from "./rest.js";
import { Scene } from "./scene.js";
import { copyLink, offerLink, save } from "./session.js";
import { openSheet } from "./sheets.js";
import { Shove } from "./shove.js";
import { Status } from "./status.js";
import { Teleop } from "./teleop.js";
import { Transport } from "./transport.js";

const element = (id) => document.getElementById(id);
const status = new Status();

// What the server refuses is told in words; that it is away is told by the strip.
function tell(error) {
  if (error instanceof Unreachable) status.lost();
  else notify(error.message, { level: "bad" });
}
const wish = (method, path, body) => ask(method, path, body).catch(tell);

const teleop = new Teleop({ onRefusal: (text) => notify(text, { level: "bad" }), onUse: () => helm.used() });
const helm = new Helm(teleop);
const pushReport = new PushReport();
const transport = new Transport({ wish });
const randomPushes = new RandomPushes({ wish });
const shove = new Shove({
  onPush: (impulse) => {
    pushReport.used();
    teleop.push(impulse);
  },
});

const actions = {
  zero: () => teleop.zero(),
  push: () => shove.push(),
  pause: () => transport.toggle(),
  help: () => openSheet(element("help-dialog")),
};
const press = (action) => actions[action]();

const stick = new Joystick(element("joystick"), { onChange: (x, y) => teleop.set("joystick", { forward: y, left: -x }) });
const ring = new Joystick(element("turn"), { isOneAxis: true, onChange: (x) => teleop.set("joystick", { turn: -x }) });
const keyboard = new Keyboard({ onChange: (axes) => teleop.set("keyboard", axes), onPress: press });
const gamepads = new Gamepads({
  onChange: (axes) => teleop.set("gamepad", axes),
  onPress: press,
  onPlug: (pad) => {
    gamepadDialog.plugged(pad);
    notify(pad ? `Gamepad connected: ${pad.id}` : "Gamepad gone");
  },
});
const gamepadDialog = new GamepadDialog(gamepads);
gamepadDialog.plugged(null);
const scene = new Scene({ client: teleop.client, onLoad: (inner) => keyboard.attach(inner) });

element("zero").addEventListener("click", actions.zero);
element("help").addEventListener("click", actions.help);
element("help-gamepad").addEventListener("click", () => gamepadDialog.open());
for (const [id, act] of [["share", () => copyLink(latest)], ["save", save]]) {
  element(id).addEventListener("click", async ({ currentTarget: button }) => {
    button.disabled = true; // while it takes its time
    await act().catch(tell);
    button.disabled = false;
  });
}
element("look").value = chosenLook();
element("look").addEventListener("change", (event) => {
  chooseLook(event.target.value);
  scene.relook();
});

// A page that is not seen holds nothing: its hand may be gone.
document.addEventListener("visibilitychange", () => {
  if (!document.hidden) return;
  for (const control of [stick, ring, keyboard]) control.release();
  teleop.release();
});

async function learnLimits() {
  const [health, robots] = await Promise.all([ask("GET", "health"), ask("GET", "robots")]);
  const { name, limits } = robots.find((robot) => robot.name === health.robot);
  element("robot").textContent = name === "hrp2" ? "HRP-2" : name[0].toUpperCase() + name.slice(1);
  teleop.learn(limits);
  shove.limit(limits.push);
  const canTurn = limits.yaw_rate[1] > limits.yaw_rate[0];
  element("turn").ariaDisabled = String(!canTurn);
  element("turn").title = canTurn ? "Drag to turn (J, L)" : "This robot does not turn yet";
  element("turn-note").textContent = canTurn ? "" : "turning: not yet";
}

let latest = {};
let wasLost = false;
new Live("/api/v1/live/stream?rate=10", {
  silence: 5000,
  onOpen: () => {
    learnLimits().catch(tell);
    if (wasLost) scene.load(); // viser's own client gives up while its frame has no focus
    wasLost = false;
  },
  onMessage: (live) => {
    latest = live;
    for (const part of [status, helm, transport, pushReport, randomPushes]) part.show(live);
  },
  onLoss: () => {
    wasLost = true;
    status.lost();
  },
});
offerLink();
