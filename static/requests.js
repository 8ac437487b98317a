// REST requests to the server, and their errors in words.

/** The server refused a request; the message is a sentence for a person. */
class RefusedError extends Error {}

/** The server cannot be reached. */
export class UnreachableError extends Error {}

/**
 * @param {string} method of HTTP
 * @param {string} path below /api/v1/
 * @param {object | Blob} [body] sent as JSON, or as it is
 * @returns {Promise<any>} the response
 * @throws {RefusedError} if the server refuses
 * @throws {UnreachableError} if it cannot be reached
 */
export async function request(method, path, body) {
  const isFile = typeof body?.arrayBuffer === "function"; // a file from the frame of the scene is no Blob of this window
  const headers = { "Content-Type": isFile ? "application/octet-stream" : "application/json" };
  const options = { method, headers, body: isFile ? body : body && JSON.stringify(body) };
  const response = await fetch(`/api/v1/${path}`, options).catch(() => {
    throw new UnreachableError("The server cannot be reached.");
  });
  const data = await response.json().catch(() => ({}));
  if (!response.ok) throw new RefusedError(inWords(data, response));
  return data;
}

function inWords({ detail, errors }, response) {
  if (response.status === 404) return "This server cannot do that.";
  if (!errors?.length) return detail || `The server responded with ${response.status}.`;
  return errors.map(({ field, value, limit }) => `${field} = ${JSON.stringify(value)}: ${limit}`).join("; ");
}
