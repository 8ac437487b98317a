// An archive of files, without compression, as every program reads it: so a run's folder goes to the server as one file.

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let bit = 0; bit < 8; bit++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n;
});

function crc32(bytes) {
  let crc = 0xffffffff;
  for (const byte of bytes) crc = CRC_TABLE[(crc ^ byte) & 0xff] ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
}

/**
 * @param {File[]} files of which no two have one name
 * @returns {Promise<Blob>} an archive of less than 4 GB
 */
export async function zip(files) {
  const parts = [];
  const directory = [];
  let offset = 0;
  for (const file of files) {
    const [name, content] = [new TextEncoder().encode(file.name), new Uint8Array(await file.arrayBuffer())];
    // Version 2.0, names in UTF-8, stored, no date; then checksum, both sizes, and the length of the name.
    const common = [20, 0x0800, 0, 0, 0x0021].flatMap(short).concat([crc32(content), content.length, content.length].flatMap(long), short(name.length));
    parts.push(Uint8Array.from([...long(0x04034b50), ...common, ...short(0)]), name, content);
    const rest = [0, 0, 0, 0].flatMap(short).concat(long(0), long(offset)); // extra, comment, disk, attributes
    directory.push(Uint8Array.from([...long(0x02014b50), ...short(20), ...common, ...rest]), name);
    offset += 30 + name.length + content.length;
  }
  const size = directory.reduce((sum, part) => sum + part.length, 0);
  const counts = [0, 0, files.length, files.length].flatMap(short);
  const end = Uint8Array.from([...long(0x06054b50), ...counts, ...long(size), ...long(offset), ...short(0)]);
  return new Blob([...parts, ...directory, end]);
}

const short = (number) => [number & 0xff, (number >>> 8) & 0xff];
const long = (number) => [...short(number & 0xffff), ...short(number >>> 16)];
