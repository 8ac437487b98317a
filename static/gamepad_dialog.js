// Dialog of the gamepad: whether one is connected, what it sends, and which stick or button does what.

import { AXES, BUTTONS, DEFAULTS, movedAxis, obstacle } from "./gamepad.js";
import { openDialog } from "./dialogs.js";

const NONE = "No gamepad yet. Plug one in and press one of its buttons: browsers show it only then.";
const element = (id) => document.getElementById(id);

export class GamepadDialog {
  /** @param {import("./gamepad.js").Gamepads} gamepads */
  constructor(gamepads) {
    Object.assign(this, { gamepads, learning: null, rest: [], shape: "" });
    this.dialog = element("gamepad-dialog");
    this.button = element("gamepad");
    this.rows = {};
    for (const [action, words] of Object.entries({ ...AXES, ...BUTTONS })) this.addRow(action, words);
    this.button.addEventListener("click", () => this.open());
    this.dialog.addEventListener("close", () => this.closed());
    element("deadzone").addEventListener("input", (event) => this.change({ deadzone: Number(event.target.value) }));
    element("gamepad-defaults").addEventListener("click", () => this.change(DEFAULTS));
  }

  open() {
    this.gamepads.isSuspended = true;
    openDialog(this.dialog);
    this.plugged(this.gamepads.pad);
    this.frames = setInterval(() => this.draw(), 50);
  }

  closed() {
    clearInterval(this.frames);
    this.learning = null;
    this.gamepads.isSuspended = false;
  }

  /** Show on the page whether there is a pad. */
  plugged(pad) {
    this.button.dataset.state = pad ? "connected" : obstacle ? "impossible" : "none";
    this.button.title = pad ? `Gamepad: ${pad.id}` : obstacle ? "Gamepad: not from this address" : "Gamepad: none connected";
    element("gamepad-note").textContent = pad ? pad.id : obstacle || NONE;
    element("gamepad-test").hidden = !pad;
    if (pad) this.lay(pad);
    this.showSettings();
  }

  addRow(action, words) {
    const row = element("gamepad-map").tBodies[0].insertRow();
    const name = document.createElement("th");
    Object.assign(name, { scope: "row", textContent: words });
    const button = Object.assign(document.createElement("button"), { type: "button" });
    button.addEventListener("click", () => this.learn(action));
    row.append(name);
    row.insertCell().append(button);
    this.rows[action] = button;
  }

  /** Show as many bars and dots as the pad has axes and buttons. */
  lay(pad) {
    const meters = pad.axes.map((_, i) => `<label>${i}<meter min="-1" max="1" aria-label="Axis ${i}"></meter></label>`);
    element("gamepad-axes").innerHTML = meters.join("");
    element("gamepad-buttons").innerHTML = pad.buttons.map((_, i) => `<span>${i}</span>`).join("");
  }

  draw() {
    const { pad } = this.gamepads;
    if (!pad) return;
    [...element("gamepad-axes").querySelectorAll("meter")].forEach((meter, i) => (meter.value = pad.axes[i]));
    [...element("gamepad-buttons").children].forEach((dot, i) => dot.classList.toggle("on", pad.buttons[i].pressed));
    if (this.learning) this.watch(pad);
  }

  learn(action) {
    const { pad } = this.gamepads;
    if (!pad) return;
    this.learning = this.learning === action ? null : action;
    this.rest = [...pad.axes];
    this.wasPressed = pad.buttons.map((button) => button.pressed);
    this.showSettings();
  }

  watch(pad) {
    const isAxis = this.learning in AXES;
    const button = pad.buttons.findIndex(({ pressed }, i) => pressed && !this.wasPressed[i]);
    const found = isAxis ? movedAxis(pad, this.rest) : button < 0 ? null : button;
    if (found === null) return;
    const action = this.learning;
    this.learning = null;
    this.change({ [action]: found });
  }

  change(values) {
    this.gamepads.change(values);
    this.showSettings();
  }

  showSettings() {
    const { settings } = this.gamepads;
    for (const [action, button] of Object.entries(this.rows)) {
      const isAxis = action in AXES;
      const what = isAxis ? `axis ${settings[action].axis} ${settings[action].sign > 0 ? "+" : "−"}` : `button ${settings[action]}`;
      const prompt = isAxis ? `move a stick: ${AXES[action]} …` : "press a button …";
      button.textContent = this.learning === action ? prompt : what;
      button.ariaLabel = `${isAxis ? AXES[action] : BUTTONS[action]}: ${button.textContent}`;
      button.ariaPressed = String(this.learning === action);
    }
    element("deadzone").value = settings.deadzone;
    element("deadzone-text").textContent = `${Math.round(100 * settings.deadzone)} %`;
  }
}
