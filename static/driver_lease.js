// Who drives: the last one to take hold, one browser alone, or another to which that one hands over.

const EVERYBODY = "";

export class DriverLease {
  /**
   * @param {{client: string, request: (method: string, path: string, body?: object) => Promise<any>}} options
   *   client: name of this page's controls
   */
  constructor({ client, request }) {
    this.client = client;
    this.request = request;
    this.select = document.getElementById("lease");
    this.select.addEventListener("change", () => this.choose());
  }

  /** Ask who drives alone, and whose controls there are. */
  async update() {
    this.show(await this.request("GET", "live/lease"));
  }

  async choose() {
    const client = this.select.value;
    const response =
      client === EVERYBODY
        ? await this.request("DELETE", `live/lease?by=${this.client}`)
        : await this.request("PUT", "live/lease", { client, by: this.client });
    if (response) this.show(response);
    else await this.update(); // it was refused
  }

  show(lease) {
    if (!lease) return;
    const others = lease.clients.filter((client) => client !== this.client);
    const canChoose = lease.holder === EVERYBODY || lease.holder === this.client;
    this.select.replaceChildren(
      new Option("whoever takes hold last", EVERYBODY),
      new Option("this browser alone", this.client),
      ...others.map((client) => new Option(`browser ${client.slice(0, 4)} alone`, client)),
    );
    this.select.value = lease.holder;
    this.select.disabled = !canChoose;
  }
}
