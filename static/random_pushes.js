// Random pushes as a mode: switched here, done by the server, and seen by every browser.

const INTERVAL = 4; // s, in the mean

export class RandomPushes {
  /** @param {{wish: (method: string, path: string, body?: object) => Promise<any>}} options */
  constructor({ wish }) {
    this.wish = wish;
    this.button = document.getElementById("random");
    this.strength = document.getElementById("strength");
    this.button.addEventListener("click", () => this.set(!this.isOn));
    this.strength.addEventListener("change", () => this.isOn && this.set(true));
  }

  get isOn() {
    return this.button.ariaPressed === "true";
  }

  set(isOn) {
    const body = isOn ? { strength: Number(this.strength.value), interval: INTERVAL } : { strength: 0 };
    this.wish("PUT", "live/random-pushes", body);
  }

  show(live) {
    const isOn = String((live.random_pushes?.strength ?? 0) > 0);
    if (this.button.ariaPressed !== isOn) this.button.ariaPressed = isOn;
  }
}
