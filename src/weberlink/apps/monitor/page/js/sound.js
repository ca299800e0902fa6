// The felt force as a tone, a contact and a packet as clicks; silent until the user switches it on.

const LOWEST_HZ = 90;
const HIGHEST_HZ = 420;
const FULL_N = 6; // force of the highest and loudest tone
const LOUDEST = 0.16;
const SMOOTH_S = 0.02;
const CLICKS = { contact: [180, 0.3, 0.06], packet: [1700, 0.05, 0.015] }; // [Hz, loudness, s]
const PACKET_GAP_S = 0.03;

export class Sound {
  constructor() {
    this.kind = "off";
  }

  // "off", "force" or "packets" (force and packets); call it in an event of the user, as browsers demand.
  choose(kind) {
    this.kind = kind;
    if (kind === "off") this.context?.suspend();
    else this.#start();
  }

  // The felt force [N], whether a contact began, and the number of packets since the last call.
  feel(force, contact, packets) {
    if (this.kind === "off" || this.context?.state !== "running") return;
    const now = this.context.currentTime;
    const share = Math.min(1, force / FULL_N);
    this.tone.frequency.setTargetAtTime(LOWEST_HZ * (HIGHEST_HZ / LOWEST_HZ) ** share, now, SMOOTH_S);
    this.loudness.gain.setTargetAtTime(LOUDEST * Math.sqrt(share), now, SMOOTH_S);
    if (contact) this.#click(...CLICKS.contact);
    if (packets && this.kind === "packets" && now - (this.clickedAt ?? 0) > PACKET_GAP_S) {
      this.clickedAt = now;
      this.#click(...CLICKS.packet);
    }
  }

  // No new rows, no tone.
  still() {
    this.loudness?.gain.setTargetAtTime(0, this.context.currentTime, SMOOTH_S);
  }

  #start() {
    if (!this.context) {
      const context = new AudioContext({ latencyHint: "interactive" });
      this.context = context;
      this.tone = new OscillatorNode(context, { type: "triangle", frequency: LOWEST_HZ });
      this.loudness = new GainNode(context, { gain: 0 });
      this.tone.connect(this.loudness).connect(context.destination);
      this.tone.start();
    }
    this.context.resume();
  }

  #click(frequency, loudness, seconds) {
    const { context } = this;
    const now = context.currentTime;
    const tone = new OscillatorNode(context, { type: "sine", frequency });
    const envelope = new GainNode(context, { gain: loudness });
    envelope.gain.exponentialRampToValueAtTime(0.001, now + seconds);
    tone.connect(envelope).connect(context.destination);
    tone.start();
    tone.stop(now + seconds);
  }
}
