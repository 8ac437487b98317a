// The phone of a visitor at the booth: stands in line, and drives while it is its turn.

import { Joystick, onTap } from "./joystick.js";
import { ReconnectingSocket } from "./reconnecting_socket.js";

const PERIOD = 100; // ms between messages of a held stick; the server takes one for released after 400
const TURN = 60; // s
const SHORT = 10; // s that are left of a turn, from which on it is shown
const PUSH_RESTS = 1500; // ms that the button rests, as long as the server takes no other push
const CLIENT_KEY = "walk.visitor"; // kept while the tab is open, so that a visitor keeps the place

const element = (id) => document.getElementById(id);
const key = new URLSearchParams(location.search).get("key") ?? "";
const client = (sessionStorage[CLIENT_KEY] ??= Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join(""));
const axes = { forward: 0, left: 0, turn: 0 };
let isHeld = false;

const socket = new ReconnectingSocket(`/api/v1/live/booth/phone?${new URLSearchParams({ key, client })}`, {
  timeout: 5000,
  onMessage: show,
  onLoss: () => show(null),
});

function steer(part) {
  Object.assign(axes, part);
  const wasHeld = isHeld;
  isHeld = Object.values(axes).some(Boolean);
  if (isHeld || wasHeld) socket.send(axes);
}

const controls = [
  new Joystick(element("joystick"), { onChange: (x, y) => steer({ forward: y, left: -x }) }),
  new Joystick(element("turn"), { isOneAxis: true, onChange: (x) => steer({ turn: -x }) }),
];
setInterval(() => isHeld && socket.send(axes), PERIOD);
document.addEventListener("visibilitychange", () => document.hidden && controls.forEach((control) => control.release()));

onTap(element("push"), () => {
  const button = element("push");
  if (!socket.send({ push: (2 * Math.random() - 1) * Math.PI })) return;
  button.disabled = true;
  setTimeout(() => (button.disabled = false), PUSH_RESTS);
  navigator.vibrate?.(30);
});
element("again").addEventListener("click", () => socket.send({ again: true }));

/** @param {object | null} state as the server tells it; null while there is no connection */
function show(state) {
  const place = placeOf(state);
  if (place !== "driving") controls.forEach((control) => control.release());
  document.body.dataset.place = place;
  element("controls").inert = place !== "driving";
  const [words, more] = inWords(place, state);
  say("place", words);
  say("more", state?.error || more);
  element("again").hidden = place !== "out";
  const bar = element("turn-left");
  bar.hidden = place !== "driving";
  if (bar.hidden) return;
  bar.style.setProperty("--left", (state.time_left / TURN).toFixed(3));
  bar.classList.toggle("is-short", state.time_left < SHORT && state.waiting > 0);
}

function placeOf(state) {
  if (!state) return "connecting";
  if (!state.is_open) return "closed";
  if (state.place === null) return "out";
  if (state.place > 0 || state.problem) return "waiting";
  return "driving";
}

function inWords(place, state) {
  const seconds = state ? Math.ceil(state.time_left) : 0;
  switch (place) {
    case "connecting":
      return ["connecting …", "If this stays, scan the code on the screen again."];
    case "closed":
      return ["The booth is closed", "It opens with the screen."];
    case "out":
      return ["Your turn is over", "Thank you for driving!"];
    case "waiting":
      if (state.problem) return ["Please wait", "Somebody drives at the screen."];
      return [state.place === 1 ? "You are next" : `${state.place} before you`, `You are number ${state.own_number}. The turn now ends in ${seconds} s.`];
    default:
      return ["You drive!", state.waiting ? `${seconds} s, ${state.waiting} waiting` : "Nobody waits: drive on."];
  }
}

function say(id, text) {
  if (element(id).textContent !== text) element(id).textContent = text;
}
