// Tour of the page in five steps, offered once, each beside what it tells of.

import { notify } from "./notices.js";

const KEY = "walk.tour";
const STEPS = [
  ["#joystick", "Drag the stick to walk: up is away from you. Let go and the robot stops, feet side by side."],
  ["#push", "Aim on the ring and push. Nothing is canned: at every tick the controller decides anew where to step."],
  ["#viewer", "Red: centre of mass. Black ring: centre of pressure, which must stay under the feet (green). Violet: capture point, where a step would stop it."],
  ["#views", "Views. Chase turns with the robot; in the others the mark on stick and ring is where the robot faces."],
  ["#presets", "Walks to try: a circle, shoves, one that is too hard, and the paper's own."],
];

export class Tour {
  constructor() {
    this.card = document.getElementById("tour");
    this.step = 0;
    document.getElementById("tour-next").addEventListener("click", () => this.go(this.step + 1));
    document.getElementById("tour-end").addEventListener("click", () => this.go(STEPS.length));
    document.getElementById("help-tour").addEventListener("click", () => {
      document.querySelector("dialog[open]")?.close();
      this.go(0);
    });
  }

  /** Offer the tour to who has not seen it. */
  offer() {
    if (localStorage.getItem(KEY) !== null) return;
    notify("New here? Five steps show what is what.", {
      actions: [
        { text: "Show me", onClick: () => this.go(0) },
        { text: "No, thanks", onClick: () => localStorage.setItem(KEY, "") },
      ],
    });
  }

  go(step) {
    this.step = step;
    document.querySelector(".is-told")?.classList.remove("is-told");
    this.card.hidden = step >= STEPS.length;
    if (this.card.hidden) return localStorage.setItem(KEY, "");
    const [target, words] = STEPS[step];
    document.querySelector(target).classList.add("is-told");
    document.getElementById("tour-text").textContent = words;
    document.getElementById("tour-count").textContent = `${step + 1} of ${STEPS.length}`;
    document.getElementById("tour-next").textContent = step + 1 < STEPS.length ? "Next" : "Done";
    document.getElementById("tour-end").hidden = step + 1 === STEPS.length;
  }
}
