// Frame with the viser scene: its colours, camera, panel and render quality, and its reload after a lost connection.

import { chosenQuality, suitableQuality, watchFrameRate } from "./render_quality.js";
import { drawDotsOver } from "./draw_over.js";
import { notify } from "./notices.js";

const dark = matchMedia("(prefers-color-scheme: dark)");
const PANEL_KEY = "walk.panel";
const FIRST_CAMERA = { initialCameraPosition: "-2.9,1.2,2.1", initialCameraLookAt: "0.2,0,0.7" }; // until a view places it
const LIGHT_PIXEL_RATIO = 0.6; // of the screen's own, along each side

export class Scene {
  /** @param {{client: string, onLoad: (window: Window) => void}} options: id of this page, and what to call each time the frame has loaded */
  constructor({ client, onLoad }) {
    this.client = client;
    this.frame = document.getElementById("viewer");
    this.toggle = document.getElementById("panel");
    this.hasPanel = localStorage.getItem(PANEL_KEY) === "open"; // closed at the first visit
    this.quality = suitableQuality();
    this.stopWatching = () => {};
    this.role = "operator";
    this.frame.addEventListener("load", () => {
      this.addStyle();
      this.watchSize();
      nameControls(this.frame.contentWindow);
      keepArrows(this.frame.contentDocument);
      cancelDragOnBlur(this.frame.contentWindow);
      drawDotsOver(this.frame.contentWindow);
      this.watch();
      onLoad(this.frame.contentWindow);
    });
    this.toggle.addEventListener("click", () => {
      this.showPanel(!this.hasPanel);
      localStorage.setItem(PANEL_KEY, this.hasPanel ? "open" : "closed");
    });
    dark.addEventListener("change", () => this.load());
    this.load();
  }

  load() {
    const query = new URLSearchParams(FIRST_CAMERA);
    const isLight = this.quality === "light";
    const socket = `${location.origin.replace("http", "ws")}/viewer${isLight ? "/light" : ""}`;
    query.set("websocket", `${socket}?client=${this.client}`);
    if (dark.matches) query.set("darkMode", "");
    if (isLight) query.set("fixedDpr", LIGHT_PIXEL_RATIO);
    this.frame.dataset.quality = this.quality;
    document.body.classList.toggle("is-light", isLight);
    this.frame.src = `/viewer/?${query}`;
  }

  /** Draw in the quality that is chosen, or that suits the machine. */
  updateQuality() {
    const quality = suitableQuality();
    if (quality === this.quality) return;
    this.quality = quality;
    this.load();
  }

  /** Reload a frame that stays slow with less to draw, unless a person chose its quality. */
  watch() {
    this.stopWatching();
    if (this.quality === "light" || chosenQuality() !== "auto") return;
    this.stopWatching = watchFrameRate(this.frame.contentWindow, () => {
      this.quality = "light";
      this.load();
      notify("The scene was slow here, so it draws less now. Help has the choice.");
    });
  }

  /** Add the page's style: a background, and viser's panel out of the way of the page's own controls. */
  addStyle() {
    const link = this.frame.contentDocument.createElement("link");
    link.rel = "stylesheet";
    link.href = "/static/viewer.css";
    this.frame.contentDocument.head.append(link);
    this.showPanel(this.hasPanel);
    this.setRole(this.role);
  }

  /** @param {"operator" | "viewer"} role of this browser: a viewer's panel shows, and takes nothing */
  setRole(role) {
    this.role = role;
    this.frame.contentDocument?.documentElement.classList.toggle("only-looks", role === "viewer");
  }

  /** Keep the page's own controls within the scene, which viser makes smaller where its panel is. */
  watchSize() {
    const { contentDocument: inner, contentWindow: window } = this.frame;
    const sizes = new window.ResizeObserver(([{ target }]) => {
      const { right, bottom } = target.getBoundingClientRect();
      document.body.style.setProperty("--beside", `${window.innerWidth - right}px`);
      document.body.style.setProperty("--below", `${window.innerHeight - bottom}px`);
    });
    const observe = () => {
      const scene = inner.querySelector("[data-dock-root] > :first-child");
      if (!scene) return;
      arrivals.disconnect();
      sizes.observe(scene);
    };
    const arrivals = new window.MutationObserver(observe);
    arrivals.observe(inner.body, { childList: true, subtree: true });
    observe();
  }

  showPanel(isShown) {
    this.hasPanel = isShown;
    this.toggle.ariaPressed = String(isShown);
    document.body.classList.toggle("has-panel", isShown);
    this.frame.contentDocument?.documentElement.classList.toggle("no-panel", !isShown);
  }
}

/** Name viser's sliders for assistive tools: those of a row get the name of its label. */
function nameControls({ document, MutationObserver }) {
  const name = () => {
    for (const label of document.querySelectorAll("p > label")) {
      const row = label.parentElement.parentElement.parentElement;
      for (const control of row.querySelectorAll("[role=slider], input")) control.ariaLabel ||= label.textContent;
    }
    colourLayers(document);
  };
  new MutationObserver(name).observe(document.body, { childList: true, subtree: true });
}

/** Put the colour of each layer beside its switch, from the legend, which is hidden then: so each is listed once. */
function colourLayers(document) {
  const legend = [...document.querySelectorAll(".layer-legend [data-layer]")];
  const colours = new Map(legend.map((entry) => [entry.dataset.layer, entry.firstElementChild.style.background]));
  if (!colours.size) return; // another tab
  for (const label of document.querySelectorAll("p > label")) {
    if (!colours.has(label.textContent)) continue;
    label.dataset.swatch = "";
    label.style.setProperty("--swatch", colours.get(label.textContent));
  }
}

/** Keep the arrow keys of a slider from moving viser's camera, too. */
function keepArrows(document) {
  document.body.addEventListener("keydown", (event) => {
    if (event.key.startsWith("Arrow") && event.target.matches("[role=slider], input")) event.stopPropagation();
  });
}

/** Cancel a drag by Escape when the window loses the focus: for viser it would end there, and push the robot. */
function cancelDragOnBlur(inner) {
  const Escape = { key: "Escape", code: "Escape", bubbles: true };
  let isDown = false;
  for (const type of ["pointerdown", "pointerup", "pointercancel"]) {
    inner.addEventListener(type, () => (isDown = type === "pointerdown"), { capture: true });
  }
  const cancel = ({ target }) => {
    if (!isDown || target !== inner) return; // a control lost the focus, not the window
    inner.document.body.dispatchEvent(new inner.KeyboardEvent("keydown", Escape));
  };
  inner.addEventListener("blur", cancel, { capture: true });
}
