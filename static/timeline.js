// Time line of the last minutes: this browser looks at earlier ticks of the walk, and lets it go on from one of them.
//
// The server draws earlier ticks in this browser's scene alone, as long as the socket `look` asks for some. One tick at a
// time is asked for: the next one goes out when the answer has come, so that a slow connection only shows fewer.

const POLL_PERIOD = 500; // ms
const MOST_RUNS = 30; // in the menu, the latest
const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4];
const NAMES = { 0.05: "1/20 ×", 0.1: "1/10 ×", 0.25: "1/4 ×", 0.5: "1/2 ×" };
const [GO_ON, RESTORING] = ["Go on from here", "Restoring …"];
const NEW_WALK = "The walk began anew, so this is the present again.";

const element = (id) => document.getElementById(id);

export class Timeline {
  /**
   * @param {object} options
   * @param {string} options.client id of this page
   * @param {(method: string, path: string, body?: object) => Promise<any>} options.request shows errors itself
   * @param {() => number[]} options.impulse of the push that the ring is set to, in the robot's frame, N s
   * @param {() => void} options.onOpen
   * @param {(past: object | null) => void} options.onPast gets the earlier tick that is shown; null for the present
   * @param {(text: string) => void} options.onTrouble
   */
  constructor({ client, request, impulse, onOpen, onPast, onTrouble }) {
    Object.assign(this, { client, request, impulse, onOpen, onPast, onTrouble });
    this.bar = element("timeline");
    this.toggleButton = element("time-back");
    this.moment = element("moment");
    this.line = null; // what the server keeps
    this.tick = null; // that is to be shown; null for the present
    this.past = null; // that is shown
    this.run = ""; // id of the recorded run that is looked at; empty for the live walk
    this.isHeld = false;
    this.isPlaying = false;
    this.source = element("past-of");
    this.source.addEventListener("change", () => this.open(this.source.value));
    this.toggleButton.addEventListener("click", () => this.toggle());
    this.moment.addEventListener("input", () => this.seek(Number(this.moment.value)));
    for (const type of ["pointerdown", "pointerup", "pointercancel"]) {
      this.moment.addEventListener(type, () => (this.isHeld = type === "pointerdown"));
    }
    element("play-speed").append(...SPEEDS.map((speed) => new Option(NAMES[speed] ?? `${speed} ×`, String(speed))));
    element("play-speed").value = "1";
    element("play").addEventListener("click", () => this.play(!this.isPlaying));
    for (const [id, step] of [["tick-back", -1], ["tick-on", 1]]) element(id).addEventListener("click", () => this.step(step));
    for (const [id, way] of [["mark-back", -1], ["mark-on", 1]]) element(id).addEventListener("click", () => this.jump(way));
    element("present").addEventListener("click", () => this.leave());
    element("go-on").addEventListener("click", () => this.goOn());
    setInterval(() => this.isOpen && !this.run && this.load(), POLL_PERIOD);
  }

  get isOpen() {
    return !this.bar.hidden;
  }

  toggle(isOpen = !this.isOpen) {
    this.bar.hidden = !isOpen;
    this.toggleButton.ariaPressed = String(isOpen);
    if (!isOpen) return this.leave();
    this.onOpen();
    this.load();
    this.listRuns();
  }

  async load() {
    const { run } = this;
    const line = await this.request("GET", run ? `runs/${run}/timeline` : "live/timeline");
    if (line && run === this.run) this.take(line);
  }

  /** Offer the runs that are done. */
  async listRuns() {
    const runs = (await this.request("GET", "runs")) ?? [];
    const done = runs.filter(({ status }) => status === "done").slice(0, MOST_RUNS);
    this.source.replaceChildren(new Option("this walk", ""), ...done.map(({ id, name }) => new Option(name, id)));
    this.source.value = this.run;
  }

  /** Look at a recorded run, or at the live walk where its id is empty. */
  async open(run) {
    this.leave();
    this.run = this.source.value = run;
    this.line = null;
    await this.load();
    if (run && run === this.run && this.line) this.seek(this.line.first_tick);
  }

  /** Show which ticks there are. */
  take(line) {
    const isNew = this.line && this.line.walk !== line.walk;
    this.line = line;
    if (isNew && this.tick !== null) this.leave(NEW_WALK);
    if (this.isHeld) return; // a track that moves below the thumb would drag the moment along
    this.moment.min = Math.min(line.first_tick, line.last_tick);
    this.moment.max = line.last_tick;
    this.showMoment();
    this.showMarks();
  }

  showMoment() {
    const { last_tick: last, control_period: period } = this.line;
    const tick = this.tick ?? last;
    this.moment.value = tick;
    const text = this.run ? `${(tick * period).toFixed(2)} s` : this.tick === null ? "now" : `${(tick - last) * period === 0 ? "" : "−"}${((last - tick) * period).toFixed(2)} s`;
    this.moment.ariaValueText = text;
    element("moment-text").textContent = text;
    element("moment-tick").textContent = `tick ${tick}`;
  }

  showMarks() {
    const { first_tick: first, last_tick: last, marks } = this.line;
    element("marks").replaceChildren(
      ...marks.map(({ tick, kind, text }) => {
        const mark = document.createElement("i");
        mark.dataset.kind = kind;
        mark.title = text;
        mark.style.setProperty("--at", last > first ? ((tick - first) / (last - first)).toFixed(4) : 0);
        return mark;
      }),
    );
  }

  /** Show an earlier tick, and whichever was asked for last once the answer has come. */
  seek(tick) {
    if (!this.line) return;
    this.tick = Math.max(this.line.first_tick, Math.min(this.line.last_tick, Math.round(tick)));
    this.showMoment();
    if (!this.socket) this.connect();
    else this.ask();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/api/v1/live/look?client=${this.client}`);
    this.socket = socket;
    this.asked = null;
    socket.onopen = () => this.ask();
    socket.onmessage = ({ data }) => {
      if (socket === this.socket) this.answer(JSON.parse(data));
    };
    socket.onclose = ({ reason }) => {
      if (socket === this.socket) this.leave(reason || "The connection to the past was lost.");
    };
  }

  ask() {
    if (this.asked !== null || this.socket.readyState !== WebSocket.OPEN || this.tick === null) return;
    this.asked = this.tick;
    this.socket.send(JSON.stringify({ tick: this.tick, run: this.run }));
  }

  answer(past) {
    const asked = this.asked;
    this.asked = null;
    if (past.error) return this.leave(past.error);
    if (!this.run && past.walk !== this.line.walk) return this.leave(NEW_WALK);
    this.past = past;
    document.body.classList.add("is-past");
    this.onPast(past);
    if (this.tick !== asked) this.ask();
  }

  /** Show the present again. */
  leave(why = "") {
    const wasPast = this.tick !== null;
    this.play(false);
    this.tick = this.past = null;
    const socket = this.socket;
    this.socket = null;
    socket?.close();
    if (this.run) {
      this.run = this.source.value = "";
      this.line = null;
      if (this.isOpen) this.load();
    }
    document.body.classList.remove("is-past");
    if (this.line) this.showMoment();
    if (wasPast) this.onPast(null);
    if (wasPast && why) this.onTrouble(why);
  }

  step(ticks) {
    if (!this.line || !this.isOpen) return;
    this.play(false);
    this.seek((this.tick ?? this.line.last_tick) + ticks);
  }

  /** Go to the next mark before or after the moment. */
  jump(way) {
    if (!this.line) return;
    this.play(false);
    const now = this.tick ?? this.line.last_tick;
    const there = this.line.marks.map(({ tick }) => tick).filter((tick) => (tick - now) * way > 0);
    if (there.length) this.seek(way < 0 ? Math.max(...there) : Math.min(...there));
  }

  play(isPlaying) {
    if (isPlaying && !this.line) return;
    if (isPlaying && this.tick === null) this.seek(this.line.first_tick); // from the beginning
    const begins = isPlaying && !this.isPlaying;
    this.isPlaying = isPlaying;
    element("play").textContent = isPlaying ? "❚❚" : "▶";
    element("play").ariaLabel = isPlaying ? "Stop playing" : "Play";
    if (!begins) return;
    let [last, exact] = [performance.now(), this.tick];
    const frame = (now) => {
      if (!this.isPlaying) return;
      if (Math.round(exact) !== this.tick) exact = this.tick; // somebody moved the thumb meanwhile
      exact += ((now - last) / 1e3 / this.line.control_period) * Number(element("play-speed").value);
      last = now;
      if (exact >= this.line.last_tick) return this.leave();
      this.seek(exact);
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /** Let the walk go on from the moment that is shown, as the menu says. */
  async goOn() {
    if (this.tick === null) return this.onTrouble("Choose an earlier moment first.");
    if (this.line.no_fork) return this.onTrouble(`There is no going on from here: ${this.line.no_fork}.`);
    const change = {
      same: {},
      present: { present_parameters: true },
      push: { push: { impulse: this.impulse() } },
      hand: { present_parameters: true, follow: false },
    }[element("go-on-with").value];
    const button = element("go-on");
    button.disabled = true;
    if (this.run) button.textContent = RESTORING; // it is walked again up to there
    const live = await this.request("POST", "live/fork", { tick: this.tick, run: this.run, ...change });
    button.disabled = false;
    button.textContent = GO_ON;
    if (!live) return; // refused, and said so
    this.leave();
    if (!live.running) await this.request("POST", "live/resume");
    this.load();
  }

  /** Follow the live snapshot: a walk that began anew has another past. */
  show(live) {
    if (this.line && !this.run && live.walk !== this.line.walk && this.isOpen) this.load();
    const { fork } = live;
    element("fork-numbers").hidden = !fork;
    if (!fork) return;
    element("fork-over").textContent = fork.is_over ? ", until it ended" : "";
    for (const walk of ["now", "was"]) {
      const { fell_at, recovery, cop_margin, velocity_error } = fork[walk];
      const cells = [
        fell_at === null ? inWords(recovery) : `fell after ${(fell_at - fork.t).toFixed(1)} s`,
        cop_margin === null ? "–" : `${(100 * cop_margin).toFixed(1)} cm`,
        `${velocity_error.toFixed(3)} m/s`,
      ];
      cells.forEach((text, i) => {
        const cell = element(`fork-${walk}`).cells[i + 1];
        if (cell.textContent !== text) cell.textContent = text;
      });
    }
  }
}

function inWords(recovery) {
  if (!recovery) return "no push";
  if (recovery.survived === null) return "catching itself …";
  if (!recovery.survived) return "fell";
  return recovery.time === null ? "caught" : `${recovery.time.toFixed(1)} s, ${recovery.steps} steps`;
}
