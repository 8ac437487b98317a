// The frame that holds the viser scene: its colours, its camera, its panel, its look, and its way back after a loss.

import { chosenLook, suitableLook, watchFrames } from "./look.js";
import { notify } from "./notices.js";

const dark = matchMedia("(prefers-color-scheme: dark)");
const ROOM_FOR_PANEL = "(min-width: 900px) and (min-height: 620px)";
const VIEWS = {
  wide: { position: "-2.45,1.75,1.55", lookAt: "0.15,0,0.78" },
  tall: { position: "-3.6,2.5,1.8", lookAt: "0.1,0,0.52" },
  low: { position: "-2.9,2.05,1.65", lookAt: "0.1,0,0.64" },
};
const ICONS = ["Commands", "Settings of the view"]; // in the head of viser's panel
const LIGHT_PIXELS = 0.6; // of the screen's own, along each side

export class Scene {
  /** @param {{client: string, onLoad: (window: Window) => void}} options: whose page, and what to call each time the frame has loaded */
  constructor({ client, onLoad }) {
    this.client = client;
    this.frame = document.getElementById("viewer");
    this.toggle = document.getElementById("panel");
    this.hasPanel = matchMedia(ROOM_FOR_PANEL).matches;
    this.look = suitableLook();
    this.stopWatching = () => {};
    this.frame.addEventListener("load", () => {
      this.dress();
      this.makeRoom();
      nameControls(this.frame.contentWindow);
      keepArrows(this.frame.contentDocument);
      letGoOnBlur(this.frame.contentWindow);
      this.watch();
      onLoad(this.frame.contentWindow);
    });
    this.toggle.addEventListener("click", () => this.showPanel(!this.hasPanel));
    dark.addEventListener("change", () => this.load());
    this.load();
  }

  load() {
    const view = innerHeight > innerWidth ? VIEWS.tall : innerHeight < 520 ? VIEWS.low : VIEWS.wide;
    const query = new URLSearchParams({ initialCameraPosition: view.position, initialCameraLookAt: view.lookAt });
    const isLight = this.look === "light";
    const socket = `${location.origin.replace("http", "ws")}/viewer${isLight ? "/light" : ""}`;
    query.set("websocket", `${socket}?client=${this.client}`);
    if (dark.matches) query.set("darkMode", "");
    if (isLight) query.set("fixedDpr", LIGHT_PIXELS);
    this.frame.dataset.look = this.look;
    document.body.classList.toggle("is-light", isLight);
    this.frame.src = `/viewer/?${query}`;
  }

  /** Draw as the choice or the machine asks. */
  relook() {
    const look = suitableLook();
    if (look === this.look) return;
    this.look = look;
    this.load();
  }

  /** A frame that stays slow is loaded anew with less to draw, unless its look was chosen by hand. */
  watch() {
    this.stopWatching();
    if (this.look === "light" || chosenLook() !== "auto") return;
    this.stopWatching = watchFrames(this.frame.contentWindow, () => {
      this.look = "light";
      this.load();
      notify("The scene was slow here, so it draws less now. Help has the choice.");
    });
  }

  /** Our ground below the scene, and viser's panel out of the way of the page's own controls. */
  dress() {
    const link = this.frame.contentDocument.createElement("link");
    link.rel = "stylesheet";
    link.href = "/static/viewer.css";
    this.frame.contentDocument.head.append(link);
    this.showPanel(this.hasPanel);
  }

  /** The page's own controls keep to the scene, which viser makes smaller where its panel is. */
  makeRoom() {
    const { contentDocument: inner, contentWindow: window } = this.frame;
    const sizes = new window.ResizeObserver(([{ target }]) => {
      const { right, bottom } = target.getBoundingClientRect();
      document.body.style.setProperty("--beside", `${window.innerWidth - right}px`);
      document.body.style.setProperty("--below", `${window.innerHeight - bottom}px`);
    });
    const arrivals = new window.MutationObserver(() => {
      const scene = inner.querySelector("[data-dock-root] > :first-child");
      if (!scene) return;
      arrivals.disconnect();
      sizes.observe(scene);
    });
    arrivals.observe(inner.body, { childList: true, subtree: true });
  }

  showPanel(isShown) {
    this.hasPanel = isShown;
    this.toggle.ariaPressed = String(isShown);
    document.body.classList.toggle("has-panel", isShown);
    this.frame.contentDocument?.documentElement.classList.toggle("no-panel", !isShown);
  }
}

/** viser's sliders and icons have no names of their own: those of a row get its label's. */
function nameControls({ document, MutationObserver }) {
  const name = () => {
    for (const label of document.querySelectorAll("p > label")) {
      const row = label.parentElement.parentElement.parentElement;
      for (const control of row.querySelectorAll("[role=slider], input")) control.ariaLabel ||= label.textContent;
    }
    document.querySelectorAll(".mantine-ActionIcon-root").forEach((icon, i) => (icon.ariaLabel ||= ICONS[i] ?? ""));
  };
  new MutationObserver(name).observe(document.body, { childList: true, subtree: true });
}

/** The arrow keys of a slider are for viser those of the camera, too. */
function keepArrows(document) {
  document.body.addEventListener("keydown", (event) => {
    if (event.key.startsWith("Arrow") && event.target.matches("[role=slider], input")) event.stopPropagation();
  });
}

/** A window that loses the focus is for viser a hand that lets go, which would push the robot: Escape comes first. */
function letGoOnBlur(inner) {
  const Escape = { key: "Escape", code: "Escape", bubbles: true };
  let isDown = false;
  for (const type of ["pointerdown", "pointerup", "pointercancel"]) {
    inner.addEventListener(type, () => (isDown = type === "pointerdown"), { capture: true });
  }
  inner.addEventListener(
    "blur",
    () => isDown && inner.document.body.dispatchEvent(new inner.KeyboardEvent("keydown", Escape)),
    { capture: true },
  );
}
