// The page on the large screen of a booth: the robot, a code that makes a phone its joystick, and whose turn it is.
//
// `?booth` shows it, `?booth=http://192.168.1.20:8000` names the address at which phones reach the server, where that
// is another one than this page's. The server keeps the booth open as long as this page is connected.

import { ReconnectingSocket } from "./reconnecting_socket.js";

const TURN = 60; // s
const FRESH = 6 * 3600e3; // ms after which the page loads itself anew, while nobody drives: screens stay on for days
const LOOPBACK = /^(localhost|127\.|\[::1\])/;

const element = (id) => document.getElementById(id);

export const isBooth = () => new URLSearchParams(location.search).has("booth");

export class Booth {
  constructor() {
    document.body.classList.add("is-booth");
    this.address = new URLSearchParams(location.search).get("booth") || location.origin;
    this.since = performance.now();
    element("booth").hidden = false;
    new ReconnectingSocket("/api/v1/live/booth/screen", {
      timeout: 5000,
      onOpen: () => this.showCode(), // a server that was started anew has another key
      onMessage: (state) => this.show(state),
    });
  }

  showCode() {
    element("booth-code").src = `/api/v1/live/booth/code.svg?${new URLSearchParams({ address: this.address, now: Date.now() })}`;
    const isUnreachable = LOOPBACK.test(new URL(this.address).host);
    element("booth-note").textContent = isUnreachable ? "No phone reaches this address. Open the page by the address of this machine in the Wi-Fi." : "";
  }

  show({ number, waiting, time_left, problem, is_attracting }) {
    let words = "Nobody drives. Be the first!";
    if (problem) words = "Somebody drives at another screen.";
    else if (number) words = `Number ${number} drives${waiting ? `, ${waiting} waiting` : ""}`;
    else if (is_attracting) words = "It walks by itself. Take over!";
    if (element("booth-state").textContent !== words) element("booth-state").textContent = words;
    const bar = element("booth-left");
    bar.hidden = !number;
    bar.style.setProperty("--left", (time_left / TURN).toFixed(3));
    element("booth-seconds").textContent = number && waiting ? `${Math.ceil(time_left)} s` : "";
    if (is_attracting && performance.now() - this.since > FRESH) location.reload();
  }
}
