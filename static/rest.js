// Requests to the server, and its refusals in words.

/** What the server refuses, in a sentence for a person. */
export class Refusal extends Error {}

/** The server is not there. */
export class Unreachable extends Error {}

/**
 * @param {string} method of HTTP
 * @param {string} path below /api/v1/
 * @param {object} [body] sent as JSON
 * @returns {Promise<any>} the answer
 * @throws {Refusal} if the server says no
 * @throws {Unreachable} if it cannot be reached
 */
export async function ask(method, path, body) {
  const options = { method, headers: { "Content-Type": "application/json" }, body: body && JSON.stringify(body) };
  const answer = await fetch(`/api/v1/${path}`, options).catch(() => {
    throw new Unreachable("The server is not there.");
  });
  const data = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Refusal(inWords(data, answer));
  return data;
}

function inWords({ detail, errors }, answer) {
  if (answer.status === 404) return "This server cannot do that.";
  if (!errors?.length) return detail || `The server answered ${answer.status}.`;
  return errors.map(({ field, value, limit }) => `${field} = ${JSON.stringify(value)}: ${limit}`).join("; ");
}
