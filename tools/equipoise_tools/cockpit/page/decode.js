// Frames of undecoded LCM messages (frames.py) -> objects with a field per LCM field.
const READ = {
  d: (v, o) => v.getFloat64(o), q: (v, o) => Number(v.getBigInt64(o)), i: (v, o) => v.getInt32(o),
  b: (v, o) => v.getInt8(o), B: (v, o) => v.getUint8(o), "?": (v, o) => v.getUint8(o) !== 0,
};
const SIZE = { d: 8, q: 8, i: 4, b: 1, B: 1, "?": 1 };
export const LIVE = 1, PLAYED = 2, HISTORY = 3;

export class Decoder {
  constructor(channels) { this.channels = channels; }

  /** One frame, or the many of a seek. */
  frames(buffer) {
    const view = new DataView(buffer);
    if (view.getUint8(0) !== 0) return [this.frame(view, 0, buffer.byteLength)];
    const frames = [];
    for (let at = 1; at < buffer.byteLength;) {
      const size = view.getUint32(at);
      frames.push(this.frame(view, at + 4, at + 4 + size));
      at += 4 + size;
    }
    return frames;
  }

  frame(view, at, end) {
    const frame = { kind: view.getUint8(at), stamp_s: view.getFloat64(at + 1), bytes: end - at };
    for (at += 9; at < end;) {
      const { channel, fields } = this.channels[view.getUint8(at)];
      const size = view.getUint16(at + 1);
      frame[channel] = this.message(view, at + 3, fields);
      at += 3 + size;
    }
    return frame;
  }

  message(view, at, fields) {
    const message = {};
    for (const [name, code, count, offset] of fields) {
      message[name] = count
        ? Array.from({ length: count }, (_, i) => READ[code](view, at + offset + i * SIZE[code]))
        : READ[code](view, at + offset);
    }
    return message;
  }
}
