// Views of the robot: where the camera stands, and whether it turns with the robot. Each browser has its own.
//
// viser follows the robot's place by moving the world; turning is done here, by small turns of the camera about its
// target, so that a person's own orbit stays. viser exposes its camera for its tests as `__viserMutable`; in a version
// that does not, the view stays as it loads.

const KEY = "walk.view";
const DEGREE = Math.PI / 180;
/** Degrees from the robot's heading to the camera, counter-clockwise; degrees above the horizon; metres in sight, and ahead. */
export const VIEWS = {
  chase: { label: "Chase", azimuth: 150, elevation: 33, extent: 2.1, ahead: 0.15 },
  front: { label: "Front", azimuth: 35, elevation: 16, extent: 1.9, ahead: 0.1 },
  side: { label: "Side", azimuth: -90, elevation: 10, extent: 2.0, ahead: 0.15 },
  top: { label: "Top", azimuth: 180, elevation: 86, extent: 1.7, ahead: 0.2 },
  free: { label: "Free" },
};
export const DEFAULT_VIEW = "chase";
const FIELD_OF_VIEW = 0.7; // rad, as the server sets it
const HEIGHT = 1.7; // m, of a robot that all lengths here are given for
const MIDDLE = 0.9; // m, height of its middle
const WIDTH = 1.3; // m that are in sight at least
const NARROW = 560; // pixels; the bar of views and the pads leave no room beside the robot
const BETWEEN_PADS = 0.65; // of their height: the legs may be seen between them
const FOLLOW_TIME = 0.5; // s in which the camera follows a turn
const NEW_SHAPE = 0.15; // relative change of the scene's shape, from which the camera is placed anew
const SQUARE = 60 * DEGREE; // a view from behind within this is as good as straight: left is left
const SETTLED = 10; // frames after which viser has placed its own first camera

export class Views {
  /**
   * @param {{onTurn: (angle: number) => void}} options
   *   onTurn gets where the robot faces on the screen: counter-clockwise from up, rad, zero for a view from behind.
   */
  constructor({ onTurn }) {
    Object.assign(this, { onTurn, inner: null, heading: 0, shown: 0, angle: 0, scale: 1, turns: 0 });
    this.bar = document.getElementById("views");
    this.overlay = document.querySelector(".overlay");
    this.buttons = Object.entries(VIEWS).map(([name, { label }], i) => {
      const title = name === "free" ? "Leave the camera to me" : `View: ${label.toLowerCase()}`;
      const button = document.createElement("button");
      Object.assign(button, { type: "button", textContent: label, title: `${title} (${i + 1})` });
      button.dataset.view = name;
      button.addEventListener("click", () => this.choose(name));
      return button;
    });
    this.bar.append(...this.buttons);
    this.set(localStorage.getItem(KEY));
    new ResizeObserver(() => this.resized()).observe(this.overlay);
  }

  /** Take a view by its name, or the default one, without moving the camera. */
  set(name) {
    this.name = name in VIEWS ? name : DEFAULT_VIEW;
    for (const button of this.buttons) button.ariaPressed = String(button.dataset.view === this.name);
  }

  choose(name) {
    this.set(name);
    localStorage.setItem(KEY, this.name);
    this.place();
  }

  next() {
    const names = Object.keys(VIEWS);
    this.choose(names[(names.indexOf(this.name) + 1) % names.length]);
  }

  /** Show a robot of another height [m]. */
  fit(height) {
    this.scale = height / HEIGHT;
    this.place();
  }

  /** Follow the camera of a scene that has just loaded. */
  attach(inner) {
    this.inner = inner;
    let last = performance.now();
    let frames = 0;
    this.turns = 0;
    const frame = (now) => {
      if (this.inner !== inner || inner.closed) return;
      if (this.controls) {
        frames += 1;
        if (frames <= SETTLED && !this.turns) this.place();
        this.follow((now - last) / 1000);
      }
      last = now;
      inner.requestAnimationFrame(frame);
    };
    inner.requestAnimationFrame(frame);
    inner.addEventListener("pointerdown", () => (this.turns += 1), { capture: true });
  }

  /** viser's camera, once its scene is there and stands upright; null before. */
  get controls() {
    const viser = this.inner?.__viserMutable;
    const world = viser?.nodeRefFromName?.["/w"];
    return world && world.matrixWorld.elements[9] > 0.9 ? viser.cameraControl : null;
  }

  show({ left_yaw, right_yaw, heading }) {
    this.heading = heading ?? left_yaw + wrapped(right_yaw - left_yaw) / 2;
  }

  /** Turn the camera with the robot, unless the view is free, and say where the robot faces on the screen. */
  follow(seconds) {
    const turn = wrapped(this.heading - this.shown) * (1 - Math.exp(-seconds / FOLLOW_TIME));
    this.shown += turn;
    if (this.name !== "free" && Math.abs(turn) > 1e-5) this.controls.rotate(turn, 0, false);
    const { x, y } = this.direction();
    const facing = wrapped(this.heading - Math.atan2(y, x));
    const angle = Math.abs(facing) < SQUARE ? 0 : facing;
    if (Math.abs(angle - this.angle) < DEGREE && (angle !== 0 || this.angle === 0)) return;
    this.angle = angle;
    this.onTurn(angle);
  }

  /** Horizontal direction in which the camera looks, or up on the screen of one that looks down; world frame. */
  direction() {
    const { camera } = this.inner.__viserMutable;
    const [, , , , a, b, c, , d, e, f] = camera.matrixWorld.elements; // its y and z axes, in three.js's world
    const up = this.inWorld([a, b, c]);
    const back = this.inWorld([d, e, f]);
    return { x: up[0] - back[0], y: up[1] - back[1] };
  }

  /** Axes of viser's world in three.js's, which has y upwards. */
  get axes() {
    const { elements: e } = this.inner.__viserMutable.nodeRefFromName["/w"].matrixWorld;
    return [e.slice(0, 3), e.slice(4, 7), e.slice(8, 11)];
  }

  inWorld(vector) {
    return this.axes.map((axis) => axis.reduce((sum, part, i) => sum + part * vector[i], 0));
  }

  inThree([x, y, z]) {
    const [i, j, k] = this.axes;
    return i.map((_, n) => x * i[n] + y * j[n] + z * k[n]);
  }

  /** Put the camera where the view has it, in front of a scene of the page's shape. */
  place() {
    const view = VIEWS[this.name];
    if (this.name === "free" || !this.controls) return;
    this.shown = this.heading;
    const { width, height } = this.overlay.getBoundingClientRect();
    if (!width || !height) return;
    this.shape = width / height;
    const { above, below: under } = coveredShares(this.overlay);
    const perMetre = 2 * Math.tan(FIELD_OF_VIEW / 2); // of distance, in height
    const distance = this.scale * Math.max(view.extent / (perMetre * (1 - above - under)), WIDTH / (perMetre * this.shape));
    const tilt = view.elevation * DEGREE;
    const below = (perMetre * distance * (under - above)) / 2; // the middle of the screen lies so far below the robot's
    const azimuth = this.heading + view.azimuth * DEGREE;
    const [forward, left] = [Math.cos(this.heading), Math.sin(this.heading)];
    // Down on the screen is down in the world, and towards the camera for one that looks from above.
    const near = below * Math.sin(tilt);
    const target = [
      view.ahead * forward + near * Math.cos(azimuth),
      view.ahead * left + near * Math.sin(azimuth),
      (this.scale * MIDDLE - below) * Math.cos(tilt),
    ];
    const away = [Math.cos(tilt) * Math.cos(azimuth), Math.cos(tilt) * Math.sin(azimuth), Math.sin(tilt)];
    const position = target.map((part, i) => part + distance * away[i]);
    this.controls.setLookAt(...this.inThree(position), ...this.inThree(target), false);
  }

  resized() {
    const { width, height } = this.overlay.getBoundingClientRect();
    if (this.shape && height && Math.abs(width / height / this.shape - 1) > NEW_SHAPE) this.place();
  }

  /** Direction on the screen, x to the right and y upwards, as fractions forward and to the left of the robot. */
  inRobotFrame(x, y) {
    const [sin, cos] = [Math.sin(this.angle), Math.cos(this.angle)];
    return { forward: rounded(y * cos - x * sin), left: rounded(-x * cos - y * sin) };
  }
}

/** Shares of the scene's height that controls cover above and below the robot, as far as they are not beside it. */
function coveredShares(overlay) {
  const { top, bottom, width, height } = overlay.getBoundingClientRect();
  const edge = (selector, side) => overlay.querySelector(selector).getBoundingClientRect()[side];
  const isNarrow = width < NARROW;
  const pads = isNarrow ? BETWEEN_PADS * (bottom - (edge(".drive", "top") || bottom)) : 0;
  return {
    above: isNarrow ? Math.min(0.2, (edge("#views", "bottom") - top) / height) : 0,
    below: Math.min(0.4, Math.max(bottom - (edge(".row", "top") || bottom), pads) / height),
  };
}

const rounded = (fraction) => Math.round(1e3 * fraction) / 1e3 + 0; // never -0, nor the rest of a sine
const wrapped = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));
