// Written by `python -m plugins.page.tests.declarations` from messages.py.

export interface SceneTitle {
  name: string;
  title: string;
}

export interface Rooms {
  start: boolean;
  scenes: SceneTitle[];
  scene: string | null;
}

export interface Hello {
  type: "hello";
  session: string | null;
  token: string | null;
  rooms: Rooms;
  readonly?: boolean;
  sides?: Partial<Record<"master" | "slave", Record<string, any> | null>>;
  present?: ("master" | "slave")[];
  names?: Record<string, string | null>;
  scene?: Record<string, any>[];
  changes?: string[];
  predictors?: string[];
  settings?: Record<string, any>;
  scheme?: string | null;
  generation?: number | null;
  link?: Record<string, number | null> | null;
  drivable?: boolean;
  workspace_m?: number | null;
  rate_hz?: number;
  states?: Record<string, string>;
  faults?: Record<string, string>;
  seen_from_start?: boolean;
  axes?: string[] | null;
  records?: boolean;
  records_why?: string | null;
  view?: string | null;
}

export interface Samples {
  type: "samples";
  side: "master" | "slave";
  t: number[];
  columns: Record<string, (number | null)[] | ((number | null)[])[]>;
}

export interface Felt {
  type: "felt";
  t: number[];
  deadbands: (number | null)[];
  error_n: (number | null)[];
  bound_n: (number | null)[];
}

export interface Alarm {
  level: string;
  name: string;
  text: string;
}

export interface Figures {
  type: "figures";
  session: string;
  figures: Record<string, any>;
  alarms: Alarm[];
  faults: Partial<Record<"master" | "slave", Record<string, number>>>;
  faults_now: Partial<Record<"master" | "slave", string | null>>;
  ended: boolean;
  seen_from_start: boolean;
  packets_per_s_now: Record<string, number | null>;
  reduction_now: Record<string, number | null>;
  engaged: Partial<Record<"master" | "slave", boolean>>;
  button: "held" | "released" | null;
  ways_now: Record<string, any>;
  paths: Record<string, any>[];
  finding: string | null;
  settings?: Record<string, any>;
  generation?: number | null;
}

export interface LogEvent {
  at: number;
  wall: number;
  level: string;
  side: "master" | "slave" | null;
  text: string;
}

export interface Events {
  type: "events";
  session: string;
  events: LogEvent[];
}

export interface Handle {
  type: "handle";
  state: "none" | "free" | "yours" | "taken";
  why: string | null;
}

export interface Launcher {
  type: "launcher";
  state: "idle" | "starting" | "running" | "failed";
  scene: string | null;
  why: string | null;
  stops: number;
}

export interface RecordingState {
  type: "recording";
  session: string;
  state: "off" | "on" | "done" | "failed";
  path: string | null;
  bytes: number;
  seconds: number;
  marks: number;
  why: string | null;
}

export interface AnswerMessage {
  type: "answer";
  to?: string;
  accepted: boolean;
  why?: string | null;
  tick?: number;
  settings?: Record<string, any>;
  pending?: Record<string, any> | null;
  generation?: number;
  link?: Record<string, number | null> | null;
  path?: string;
  sessions?: string[];
}

export interface ChangeRequest {
  token?: string;
  type: "change";
  weber?: number;
  predictor?: string;
  delay_ms?: number;
  jitter_ms?: number;
  loss?: number;
}

export interface DriveRequest {
  token?: string;
  type: "drive";
  target: [number, number, number];
  held: boolean;
}

export interface SessionRequest {
  token?: string;
  type: "session";
  do: "start" | "stop";
  scene?: string | null;
  stops?: number;
}

export interface EmergencyRequest {
  token?: string;
  type: "emergency";
  age_ms?: number;
}

export interface RecordRequest {
  token?: string;
  type: "record";
  do: "start" | "stop" | "mark";
  name?: string | null;
  text?: string | null;
}

export type Message = Hello | Samples | Felt | Figures | Events | Handle | Launcher | RecordingState | AnswerMessage;
export type Request = ChangeRequest | DriveRequest | SessionRequest | EmergencyRequest | RecordRequest;
