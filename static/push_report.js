// What became of the last push, above the dial.

const HINT = "Aim the ring, then push";

export class PushReport {
  constructor() {
    this.caption = document.getElementById("last-push");
    this.random = document.getElementById("random");
    this.hasPushed = localStorage.getItem("walk.hasPushed") !== null;
  }

  show(live) {
    const words = live.last_push ? outcome(live.last_push) : this.hasPushed ? "" : HINT;
    if (this.caption.textContent !== words) this.caption.textContent = words;
    this.caption.dataset.outcome = live.last_push?.survived === false ? "bad" : "";
    this.caption.classList.toggle("hint", words === HINT);
  }

  /** The first use takes the hint away, for good. */
  used() {
    this.hasPushed = true;
    localStorage.setItem("walk.hasPushed", "");
  }
}

function outcome({ impulse, survived, steps }) {
  const strength = `${Math.hypot(...impulse).toFixed(0)} N·s`;
  if (survived === null) return `${strength}: catching itself …`;
  if (!survived) return `fell to ${strength}`;
  if (!steps) return `${strength}: caught without a step`;
  return `${strength}: caught in ${steps} ${steps === 1 ? "step" : "steps"}`;
}
