// Dots on the ground are drawn over the feet that stand on them: viser draws a picture only where nothing is before it.
//
// viser exposes its nodes for its tests as `__viserMutable`; in a version that does not, solid feet hide the dots.

const PERIOD = 500; // ms; nodes come when their pictures are there, and come anew when these change
const DOT = "/face"; // at the end of their names
const FIRST = 10; // place in the order of drawing, after all that is not drawn over

/** @param {Window} inner that has viser's scene */
export function drawDotsOver(inner) {
  const check = inner.setInterval(() => {
    if (inner.closed) return inner.clearInterval(check);
    for (const child of inner.__viserMutable?.scene?.children ?? []) {
      if (child.line && child.cone) child.line.visible = child.cone.visible = false; // viser's arrow of a drag, over ours
    }
    for (const [name, node] of Object.entries(inner.__viserMutable?.nodeRefFromName ?? {})) {
      if (!name.endsWith(DOT)) continue;
      const height = node?.parent?.position.z ?? 0; // the higher one is drawn later
      node?.traverse?.((part) => {
        if (!part.material) return;
        part.renderOrder = FIRST + 1e3 * height;
        part.material.depthTest = false;
      });
    }
  }, PERIOD);
}
