// The robot that walks: a menu below its name of those that may, which changes it for everybody who watches.

import { notify } from "./notices.js";
import { request } from "./requests.js";

export class RobotMenu {
  /** @param {{onChange: () => void, onSave: () => void, onError: (error: Error) => void}} options
   *    onChange is called once another robot walks, onSave to save the walk of the one before. */
  constructor({ onChange, onSave, onError }) {
    Object.assign(this, { onChange, onSave, onError, name: "" });
    this.title = document.getElementById("robot");
    this.menu = document.getElementById("robots");
    this.menu.addEventListener("change", () => this.choose(this.menu.value).catch(onError));
  }

  /** Offer robots, as the server lists them. */
  offer(robots) {
    const options = robots.map(({ name, title }) => new Option(title, name));
    options.sort((one, other) => one.text.localeCompare(other.text));
    this.menu.replaceChildren(...options);
    this.mark();
  }

  /** Let another robot walk; it takes some seconds, in which the one before walks on. */
  async choose(name) {
    const before = this.title.textContent;
    this.menu.disabled = true;
    this.title.textContent = `${this.menu.selectedOptions[0]?.text ?? name} …`;
    try {
      const { title } = await request("PUT", "live/robot", { robot: name });
      notify(`${title} walks now, for everybody who watches.`, { actions: [{ text: `Save ${before}’s walk`, onClick: this.onSave }] });
    } catch (error) {
      this.title.textContent = before;
      throw error;
    } finally {
      this.menu.disabled = false;
      this.mark();
    }
  }

  /** Follow the robot of the live state, whoever chose it. */
  show({ robot }) {
    if (robot === this.name) return;
    const isAnother = this.name !== "";
    this.name = robot;
    this.mark();
    if (isAnother) this.onChange();
  }

  mark() {
    if (this.name) this.menu.value = this.name;
  }
}
