// Worker: keeps the joystick's messages coming while the page is busy drawing.
//
// The server takes a silence of 0.4 s for a hand that has left. A page that draws in
// software can be silent for longer, but must show a sign of life all the same.

import { Live } from "./live.js";

const PERIOD = 50; // ms
const SIGN_OF_LIFE = 2000; // ms without which a held stick counts as let go

const link = new Live(`/api/v1/live/teleop${location.search}`, { onMessage: ({ error }) => postMessage(error) });
let held = null;
let heard = 0;

onmessage = ({ data }) => {
  heard = performance.now();
  if ("held" in data) held = data.held;
  if (data.message) link.send(data.message);
};

setInterval(() => {
  if (held && performance.now() - heard < SIGN_OF_LIFE) link.send(held);
}, PERIOD);
