// Lessons: each asks for a guess, lets the server simulate its walks, shows them in this browser alone, and says what
// their metrics say. The robot of the page goes on meanwhile, so that a class works through them at the same time.

import { request } from "./requests.js";

const POLL_PERIOD = 300; // ms
const NOT_AS_WRITTEN = " That is not what the text below explains, which was written for another robot or version.";
const LENGTH_UNITS = { "[m]": [100, "cm"], "[m/s]": [100, "cm/s"] };

const element = (id) => document.getElementById(id);
const made = (tag, properties) => Object.assign(document.createElement(tag), properties);

export class Lessons {
  /** @param {{timeline: import("./timeline.js").Timeline, onError: (error: Error) => void}} options */
  constructor({ timeline, onError }) {
    Object.assign(this, { timeline, onError });
    this.card = element("lesson");
    this.all = [];
    this.lesson = null; // that is open
    this.attempt = 0; // number of the experiment; what an earlier one brings is dropped
    this.runs = []; // of the experiment: name and title of the walk, id of the run
    this.onPresent = () => {};
    element("lesson-end").addEventListener("click", () => this.end());
    element("lesson-guess").addEventListener("change", () => (element("lesson-run").disabled = false));
    element("lesson-guess").addEventListener("submit", (event) => {
      event.preventDefault();
      this.run().catch((error) => this.fail(error));
    });
    element("lesson-next").addEventListener("click", () => this.open(this.following));
    element("presets").addEventListener("click", () => this.load().catch(onError));
  }

  /** Fetch the lessons, and open one if it is named. */
  async load(name = null) {
    this.all = await request("GET", "lessons");
    element("lessons").hidden = this.all.length === 0;
    element("lessons-list").replaceChildren(...this.all.map((lesson) => this.row(lesson)));
    if (name === null) return;
    const named = this.all.find((lesson) => lesson.name === name);
    if (!named) throw new Error(`There is no lesson “${name}”.`);
    this.open(named);
  }

  row(lesson) {
    const row = document.createElement("li");
    const open = made("button", { type: "button", textContent: lesson.title });
    open.addEventListener("click", () => {
      element("presets-dialog").close();
      this.open(lesson);
    });
    row.append(open, made("a", { textContent: "link", href: `#lesson=${lesson.name}`, ariaLabel: `Link to: ${lesson.title}` }));
    return row;
  }

  /** The lesson after the one that is open; none after the last. */
  get following() {
    return this.all[this.all.indexOf(this.lesson) + 1];
  }

  open(lesson) {
    this.end();
    this.lesson = lesson;
    this.guess = null;
    element("lesson-title").textContent = lesson.title;
    element("lesson-text").innerHTML = lesson.before; // made by the server, which lets no HTML of the file through
    element("lesson-question").textContent = lesson.question;
    element("lesson-choices").replaceChildren(...lesson.choices.map(({ name, text }) => choice(name, text)));
    element("lesson-choices").disabled = false;
    element("lesson-run").disabled = true;
    element("lesson-guess").hidden = false;
    say("");
    delete element("lesson-state").dataset.outcome;
    element("lesson-result").hidden = true;
    this.card.hidden = false;
    this.card.scrollTop = 0;
  }

  end() {
    this.attempt += 1;
    this.card.hidden = true;
    this.card.classList.remove("is-watching");
    if (this.lesson && this.timeline.run) this.timeline.leave();
    this.lesson = null;
  }

  fail(error) {
    if (this.lesson) this.open(this.lesson);
    this.onError(error);
  }

  /** Simulate the walks, show each of them when it is done, and then say what they say. */
  async run() {
    const { lesson } = this;
    const attempt = ++this.attempt;
    const isOver = () => attempt !== this.attempt;
    this.guess = new FormData(element("lesson-guess")).get("choice");
    element("lesson-choices").disabled = true;
    element("lesson-run").disabled = true;
    say("simulating …");
    element("lesson-state").scrollIntoView({ block: "nearest" });
    this.runs = [];
    for (const { name, scenario } of lesson.walks) {
      const { id } = await request("POST", "runs", scenario);
      this.runs.push({ name, title: scenario.name, id });
    }
    for (const walk of this.runs) {
      await this.simulated(walk, isOver);
      if (isOver()) return;
      await this.watch(walk);
      if (isOver()) return;
    }
    const query = new URLSearchParams(this.runs.map(({ id }) => ["run", id]));
    const outcome = await request("GET", `lessons/${lesson.name}/outcome?${query}`);
    if (!isOver()) this.showResult(outcome);
  }

  /** Wait until a walk is simulated. */
  async simulated({ id, title }, isOver) {
    while (!isOver()) {
      const { status, reason, progress } = await request("GET", `runs/${id}`);
      if (status === "done" || isOver()) return;
      if (["failed", "cancelled"].includes(status)) throw new Error(`A walk could not be simulated: ${reason || status}`);
      say(status === "queued" ? "waiting for its turn …" : `simulating: ${title}, ${Math.round(100 * progress)} %`);
      await new Promise((go) => setTimeout(go, POLL_PERIOD));
    }
  }

  /** Play a walk in the scene of this browser, until it is over or skipped. */
  async watch({ id, title }) {
    const { attempt } = this;
    const skip = made("button", { type: "button", textContent: "Skip" });
    skip.addEventListener("click", () => this.timeline.leave());
    say("", made("span", { textContent: `You see: ${title}` }), skip);
    await this.timeline.open(id);
    if (attempt !== this.attempt || this.timeline.run !== id || this.timeline.tick === null) return; // it cannot be shown
    this.card.classList.add("is-watching");
    const isPresent = new Promise((resolve) => (this.onPresent = resolve));
    this.timeline.play(true);
    await isPresent;
    this.card.classList.remove("is-watching");
  }

  /** The scene shows the present again: a walk is over, or somebody does not want to see it. */
  showPresent() {
    this.onPresent();
  }

  /** @param {object} outcome as the server gives it */
  showResult(outcome) {
    const { lesson, guess } = this;
    const text = (name) => lesson.choices.find((each) => each.name === name).text;
    const isRight = outcome.right.includes(guess);
    if (!outcome.right.length) say("The experiment proved none of the answers.");
    else say(isRight ? "You guessed right." : `The experiment says otherwise: ${outcome.right.map(text).join(" Or: ")}`);
    element("lesson-state").dataset.outcome = isRight ? "right" : "wrong";
    if (!outcome.right.includes(outcome.answer)) element("lesson-state").append(NOT_AS_WRITTEN);
    for (const input of element("lesson-choices").querySelectorAll("input")) {
      input.parentElement.dataset.outcome = outcome.right.includes(input.value) ? "right" : input.value === guess ? "wrong" : "";
    }
    this.showNumbers(outcome.measured);
    element("lesson-after").innerHTML = outcome.after;
    element("lesson-again").replaceChildren(...this.runs.map((walk) => this.again(walk)));
    element("lesson-next").hidden = !this.following;
    element("lesson-result").hidden = false;
    element("lesson-state").scrollIntoView({ block: "start" });
  }

  again(walk) {
    const button = made("button", { type: "button", textContent: `▶ ${walk.title}` });
    button.addEventListener("click", async () => {
      const { attempt } = this;
      const before = [...element("lesson-state").childNodes];
      await this.watch(walk);
      if (attempt === this.attempt) say("", ...before);
    });
    return button;
  }

  showNumbers(measured) {
    const table = element("lesson-result").querySelector("table");
    const heads = ["", ...this.runs.map(({ title }) => title)].map((textContent) => made("th", { textContent, scope: "col" }));
    const row = document.createElement("tr");
    row.append(...heads);
    table.tHead.replaceChildren(row);
    table.tBodies[0].replaceChildren(
      ...measured.map(({ metric, meaning, values }) => {
        const line = document.createElement("tr");
        line.append(made("th", { textContent: metric.replaceAll("_", " "), title: meaning, scope: "row" }));
        line.append(...this.runs.map(({ name }) => made("td", { textContent: inWords(values[name], meaning) })));
        return line;
      }),
    );
  }
}

/** What is going on, below the guess. */
function say(text, ...more) {
  element("lesson-state").replaceChildren(text, ...more);
}

function choice(name, text) {
  const label = document.createElement("label");
  label.append(made("input", { type: "radio", name: "choice", value: name }), made("span", { textContent: text }));
  return label;
}

/** A measured value with its unit, which ends its meaning. */
function inWords(value, meaning) {
  if (value === null) return "–";
  const unit = meaning.match(/\[[^\]]+\]$/)?.[0] ?? "";
  const [factor, name] = LENGTH_UNITS[unit] ?? [1, unit.slice(1, -1)];
  if (Number.isInteger(value) && !unit) return String(value);
  const shown = factor * value;
  return `${shown.toFixed(Math.abs(shown) < 100 ? 1 : 0)} ${name}`.trim();
}
