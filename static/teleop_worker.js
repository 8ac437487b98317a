// Worker that repeats the teleop messages of a held control while the page is busy drawing.
//
// The server takes a control for released that sends nothing for 0.4 s. A page that draws in software can be busy for
// longer than that, but has to send heartbeats to this worker all the same.

import { ReconnectingSocket } from "./reconnecting_socket.js";

const PERIOD = 50; // ms
const HEARTBEAT_TIMEOUT = 2000; // ms without a heartbeat, after which a held control counts as released

const PUSH_WAITS = 3000; // ms that a push waits for the connection: one that comes later than that surprises

const socket = new ReconnectingSocket(`/api/v1/live/teleop${location.search}`, {
  onMessage: ({ error }) => postMessage(error),
  onOpen: () => {
    if (waiting && performance.now() - waiting.since < PUSH_WAITS) socket.send(waiting.message);
    waiting = null;
  },
});
let held = null;
let waiting = null; // the latest push that found no connection, and since when it waits
let lastHeartbeat = 0;

onmessage = ({ data }) => {
  lastHeartbeat = performance.now();
  if ("held" in data) held = data.held;
  const { message } = data;
  if (message && !socket.send(message) && message.push) waiting = { message, since: performance.now() };
};

setInterval(() => {
  if (held && performance.now() - lastHeartbeat < HEARTBEAT_TIMEOUT) socket.send(held);
}, PERIOD);
