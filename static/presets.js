// Presets: short walks to look at first, played on the live robot from the scenarios that ship, each with a link.

import { openDialog } from "./dialogs.js";
import { notify } from "./notices.js";
import { request } from "./requests.js";

/** What is not the scenario's own: parameters, and by how much its pushes are stronger. */
export const PRESETS = {
  circle: { title: "A circle", sentence: "It walks a whole circle; only the speed and the rate of turn are asked for, the steps are its own.", scenario: "circle" },
  shove: { title: "Shove it", sentence: "Four shoves from all sides. It stands, or steps where standing is not enough.", scenario: "pushes-while-standing" },
  "too-hard": { title: "Too hard", sentence: "The same shoves, three times as hard: no step that its legs can reach catches the first.", scenario: "pushes-while-standing", strength: 3 },
  "without-gamma": { title: "Without gamma", sentence: "The paper's walk with gamma at zero: nothing draws the pressure to the middle of the feet.", scenario: "herdt-2010-section-6", parameters: { scheme: "speed_and_jerk" } },
  paper: { title: "The paper's section 6", sentence: "Ahead, a push to the left, sideways, ahead again, and a stop: the sample motion of Herdt et al. 2010.", scenario: "herdt-2010-section-6" },
};

/** An event of a walk in the proportions of another robot: the same shares of its fastest walk and of its strongest push. */
export function scaled({ reference, push, ...event }, from, to) {
  const walked = ([key, part]) => {
    const side = part < 0 ? 0 : 1; // robots walk backward more slowly
    return [key, part && to[key][side] * (part / from[key][side])]; // in this order the fastest is exactly the fastest
  };
  if (reference) event.reference = Object.fromEntries(Object.entries(reference).map(walked));
  if (push) event.push = { ...push, impulse: push.impulse.map((part) => (part * to.push) / from.push) };
  return event;
}

export class Presets {
  /** @param {{onError: (error: Error) => void}} options */
  constructor({ onError }) {
    this.onError = onError;
    this.playing = null;
    this.dialog = document.getElementById("presets-dialog");
    const rows = Object.entries(PRESETS).map(([name, preset]) => this.row(name, preset));
    document.getElementById("presets-list").append(...rows);
    document.getElementById("presets").addEventListener("click", () => openDialog(this.dialog));
  }

  row(name, { title, sentence }) {
    const row = document.createElement("li");
    const play = Object.assign(document.createElement("button"), { type: "button", textContent: title });
    const words = Object.assign(document.createElement("p"), { textContent: sentence });
    const link = Object.assign(document.createElement("a"), { textContent: "link", href: `#preset=${name}` });
    link.ariaLabel = `Link to: ${title}`;
    play.addEventListener("click", () => {
      this.dialog.close();
      this.play(name).catch(this.onError);
    });
    row.append(play, words, link);
    return row;
  }

  /** Start a preset from rest, for everybody who watches. */
  async play(name) {
    const { scenario: of, parameters, strength = 1, sentence } = PRESETS[name];
    const [scenarios, defaults, robots, { limits }] = await Promise.all(
      ["scenarios", "live/parameters/defaults", "robots", "live/robot"].map((path) => request("GET", path)),
    );
    const scenario = scenarios.find((each) => each.name === of);
    const written = robots.find((robot) => robot.name === scenario.robot)?.limits ?? limits; // for whom its numbers are
    this.playing = null;
    await request("POST", "live/reset");
    await request("PATCH", "live/parameters", { ...defaults, ...scenario.parameters, ...parameters });
    await request("POST", "live/resume");
    this.playing = { events: scenario.events.map((event) => scaled(event, written, limits)), strength, last: 0 };
    notify(sentence);
  }

  /** Send what is due. A reset, or somebody who drives, ends the preset. */
  show({ t, driver, status }) {
    const { playing } = this;
    if (!playing) return;
    if (t < playing.last || status === 2 || !["none", "rest"].includes(driver)) {
      this.playing = null;
      return;
    }
    playing.last = t;
    while (playing.events.length && playing.events[0].t <= t) this.send(playing.events.shift(), playing.strength);
  }

  send({ reference, push, parameters }, strength) {
    const sent = [];
    if (parameters) sent.push(request("PATCH", "live/parameters", parameters));
    if (reference) sent.push(request("PUT", "live/reference", reference));
    if (push) sent.push(request("POST", "live/push", { ...push, impulse: push.impulse.map((part) => strength * part) }));
    Promise.all(sent).catch(this.onError);
  }
}
