// Wiring of the page: input goes to the server, the state of the robot comes back.

import { Booth, isBooth } from "./booth.js";
import { openDialog } from "./dialogs.js";
import { DriverDisplay } from "./driver.js";
import { DriverLease } from "./driver_lease.js";
import { GamepadDialog } from "./gamepad_dialog.js";
import { Gamepads } from "./gamepad.js";
import { Joystick } from "./joystick.js";
import { Keyboard } from "./keyboard.js";
import { Lessons } from "./lessons.js";
import { notify } from "./notices.js";
import { PRESETS, Presets } from "./presets.js";
import { PushDial, PushReport, PushRose, RandomPushes } from "./push.js";
import { ReconnectingSocket } from "./reconnecting_socket.js";
import { chooseQuality, chosenQuality } from "./render_quality.js";
import { UnreachableError, request } from "./requests.js";
import { RobotMenu } from "./robots.js";
import { Scene } from "./scene.js";
import { copyLink, offerLink, saveRecording } from "./share.js";
import { Status } from "./status.js";
import { Teleop } from "./teleop.js";
import { TimeControls } from "./time_controls.js";
import { Timeline } from "./timeline.js";
import { Tour } from "./tour.js";
import { Uploads } from "./uploads.js";
import { VIEWS, Views } from "./views.js";

const element = (id) => document.getElementById(id);
const status = new Status();
let latest = {};
const SWITCHED = 300; // ms after which a click in the panel has come to the server
const DRIVES_NOW = "You drive the robot of now, so this is the present again.";

/** Show an error: a refusal as a notice, a lost server in the strip. */
function showError(error) {
  if (error instanceof UnreachableError) status.lost();
  else notify(error.message, { level: "bad" });
}
const requestAndShow = (method, path, body) => request(method, path, body).catch(showError);

/** Show what the scene shows: the present, or an earlier tick. */
function showMoment(live, isPast) {
  status.show(live, isPast);
  views.show(live);
}

/** Say that what was asked for waits, where it does. */
function sayThatTimeStands() {
  if (latest.running === false && latest.status !== 2) notify("Time stands still. This waits until you resume (P).");
}

const teleop = new Teleop({
  onRefusal: (text) => notify(text, { level: "bad" }),
  onEngage: () => {
    driver.dismissHint();
    timeline.leave(DRIVES_NOW);
    sayThatTimeStands();
  },
});
const driver = new DriverDisplay(teleop);
const lease = new DriverLease({ client: teleop.client, request: requestAndShow });
const pushReport = new PushReport();
const time = new TimeControls({ request: requestAndShow });
const randomPushes = new RandomPushes({ request: requestAndShow });
const dial = new PushDial({
  onPush: (impulse) => {
    pushReport.dismissHint();
    timeline.leave(DRIVES_NOW);
    sayThatTimeStands();
    teleop.push(impulse);
  },
});
const pushRose = new PushRose({ dial, client: teleop.client, request: requestAndShow });

const timeline = new Timeline({
  client: teleop.client,
  request: requestAndShow,
  impulse: () => dial.impulse,
  onOpen: () => matchMedia("(max-width: 576px)").matches && scene.showPanel(false), // there is room for one of them
  onTrouble: (text) => notify(text),
  onPast: (past) => {
    showMoment(past ?? latest, past !== null);
    if (past === null) lessons.showPresent();
  },
});
const presets = new Presets({ onError: showError });
const uploads = new Uploads({ timeline, robot: () => latest.robot, onError: showError });
const lessons = new Lessons({ timeline, onError: showError });
const tour = new Tour();
const views = new Views({
  onTurn: (angle) => {
    document.body.classList.toggle("is-turned", angle !== 0);
    document.body.style.setProperty("--front", `${angle}rad`);
    dial.setFront(angle);
    driver.setFront(angle);
  },
});

const actions = {
  zero: () => teleop.zero(),
  push: () => dial.push(),
  rose: () => pushRose.toggle(),
  pause: () => time.toggle(),
  standUp: () => status.hasFallen && time.reset(),
  view: () => views.next(),
  timeline: () => timeline.toggle(),
  tickBack: () => timeline.step(-1),
  tickOn: () => timeline.step(1),
  ...Object.fromEntries(Object.keys(VIEWS).map((name) => [name, () => views.choose(name)])),
  help: () => {
    lease.update();
    openDialog(element("help-dialog"));
  },
};
const press = (action) => actions[action]();

const stick = new Joystick(element("joystick"), { onChange: (x, y) => teleop.set("joystick", views.inRobotFrame(x, y)) });
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
const scene = new Scene({
  client: teleop.client,
  onLoad: (inner) => {
    keyboard.attach(inner);
    views.attach(inner);
    uploads.attach(inner);
    inner.addEventListener("click", () => setTimeout(() => pushRose.update(), SWITCHED)); // perhaps in the panel
  },
});

element("zero").addEventListener("click", actions.zero);
element("help").addEventListener("click", actions.help);
element("help-gamepad").addEventListener("click", () => gamepadDialog.open());
for (const [id, act] of [["share", () => copyLink(latest, views.name, teleop.client)], ["save", () => saveRecording()]]) {
  element(id).addEventListener("click", async ({ currentTarget: button }) => {
    button.disabled = true; // while it takes its time
    await act().catch(showError);
    button.disabled = false;
  });
}
element("quality").value = chosenQuality();
element("quality").addEventListener("change", (event) => {
  chooseQuality(event.target.value);
  scene.updateQuality();
});

// A page that is not visible releases its controls: nobody may be there.
document.addEventListener("visibilitychange", () => {
  if (!document.hidden) return;
  for (const control of [stick, ring, keyboard]) control.release();
  teleop.release();
});

/** Ask for the robot that walks and for what this browser may do, and set the controls to that. */
async function loadSession() {
  const [{ title, limits, height }, robots, { role }] = await Promise.all(["live/robot", "robots", "session"].map((path) => request("GET", path)));
  document.body.classList.toggle("only-looks", role === "viewer");
  scene.setRole(role);
  driver.setRole(role);
  if (role === "viewer") teleop.disconnect();
  element("robot").textContent = title;
  robotMenu.offer(robots);
  views.fit(height);
  teleop.setLimits(limits);
  dial.setLimit(limits.push);
  const canTurn = limits.yaw_rate[1] > limits.yaw_rate[0];
  element("turn").ariaDisabled = String(!canTurn);
  element("turn").title = canTurn ? "Drag to turn (J, L)" : "This robot does not turn yet";
  element("turn-note").textContent = canTurn ? "" : "turning: not yet";
}

const robotMenu = new RobotMenu({
  onChange: () => {
    loadSession().catch(showError);
    scene.load(); // another robot has a scene of its own
  },
  onSave: () => saveRecording({ before_reset: true }).catch(showError),
  onError: showError,
});

let wasLost = false;
new ReconnectingSocket("/api/v1/live/stream?rate=10", {
  timeout: 5000,
  onOpen: () => {
    loadSession().catch(showError);
    if (wasLost) scene.load(); // viser's own client gives up while its frame has no focus
    wasLost = false;
  },
  onMessage: (live) => {
    latest = live;
    if (!timeline.past) showMoment(live, false);
    for (const part of [driver, time, pushReport, pushRose, randomPushes, presets, timeline, robotMenu]) part.show(live);
  },
  onLoss: () => {
    wasLost = true;
    status.lost();
  },
});
offerLink({ client: teleop.client, onView: (view) => views.choose(view), onPreset: (name) => presets.play(name), presets: PRESETS, onLesson: (name) => lessons.load(name).catch(showError) });
if (isBooth()) new Booth();
else tour.offer();
addEventListener("hashchange", () => location.reload()); // a link of the list of presets
