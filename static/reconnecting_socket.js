// Websocket that reconnects: retries with growing pauses, and takes silence for a loss.

const FIRST_PAUSE = 300; // ms
const LONGEST_PAUSE = 4000; // ms
const CHECK_PERIOD = 500; // ms

export class ReconnectingSocket {
  /**
   * @param {string} path of the websocket on this host
   * @param {{onMessage?: (data: object) => void, onOpen?: () => void, onLoss?: () => void, timeout?: number}} options
   *   timeout: ms without a message after which the connection counts as lost; never by default.
   */
  constructor(path, { onMessage = () => {}, onOpen = () => {}, onLoss = () => {}, timeout = Infinity }) {
    Object.assign(this, { onMessage, onOpen, onLoss, checksSinceMessage: 0 });
    this.address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`;
    this.pause = FIRST_PAUSE;
    this.connect();
    // Checks are counted, not seconds: a page too busy to read its messages is too busy for these, too.
    setInterval(() => this.socket && ++this.checksSinceMessage * CHECK_PERIOD > timeout && this.lose(this.socket), CHECK_PERIOD);
  }

  connect() {
    const socket = new WebSocket(this.address);
    this.socket = socket;
    this.checksSinceMessage = 0;
    socket.onopen = () => {
      this.pause = FIRST_PAUSE;
      this.onOpen();
    };
    socket.onmessage = (event) => {
      this.checksSinceMessage = 0;
      this.onMessage(JSON.parse(event.data));
    };
    socket.onclose = () => this.lose(socket);
  }

  lose(socket) {
    if (socket !== this.socket) return;
    this.socket = null;
    socket.close();
    this.onLoss();
    setTimeout(() => this.connect(), this.pause);
    this.pause = Math.min(2 * this.pause, LONGEST_PAUSE);
  }

  /** Send a message if the connection is open; whether it is. */
  send(message) {
    const isOpen = this.socket?.readyState === WebSocket.OPEN;
    if (isOpen) this.socket.send(JSON.stringify(message));
    return isOpen;
  }
}
