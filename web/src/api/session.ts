import { Code, ConnectError, createClient, type Client, type Interceptor } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import { computed, signal } from "@preact/signals";
import { AcceptanceService } from "./gen/taclink/v1/acceptance_pb";
import { OperationsService, Role, type GetCallerResponse } from "./gen/taclink/v1/operations_pb";
import { PressureService } from "./gen/taclink/v1/pressure_pb";
import { RecordingService } from "./gen/taclink/v1/recording_pb";
import { SimulationService } from "./gen/taclink/v1/simulation_pb";
import { TactileService } from "./gen/taclink/v1/tactile_pb";

const TOKEN_KEY = "taclink.token";

/** Who uses this page, and the calls to the server that it came from. */
export class Session {
  readonly tactile: Client<typeof TactileService>;
  readonly recording: Client<typeof RecordingService>;
  readonly operations: Client<typeof OperationsService>;
  readonly acceptance: Client<typeof AcceptanceService>;
  readonly pressure: Client<typeof PressureService>;
  readonly simulation: Client<typeof SimulationService>;

  /** As the server sees the user; undefined: not asked yet. */
  readonly caller = signal<GetCallerResponse | undefined>(undefined);
  readonly mayOperate = computed(() => this.caller.value?.role === Role.OPERATOR);
  readonly maySee = computed(() => (this.caller.value?.role ?? 0) >= Role.VIEWER);
  /** Changes whenever the token does: what is open under the old one has to begin again. */
  readonly generation = signal(0);

  private token = sessionStorage.getItem(TOKEN_KEY) ?? localStorage.getItem(TOKEN_KEY) ?? "";

  constructor() {
    const withToken: Interceptor = (next) => (request) => {
      if (this.token) request.header.set("authorization", `Bearer ${this.token}`);
      return next(request);
    };
    const transport = createGrpcWebTransport({ baseUrl: callBase(location.href), interceptors: [withToken] });
    this.tactile = createClient(TactileService, transport);
    this.recording = createClient(RecordingService, transport);
    this.operations = createClient(OperationsService, transport);
    this.acceptance = createClient(AcceptanceService, transport);
    this.pressure = createClient(PressureService, transport);
    this.simulation = createClient(SimulationService, transport);
  }

  /** Asks the server who the user is. Throws what the call throws. */
  async refresh(): Promise<GetCallerResponse> {
    const caller = await this.operations.getCaller({}, { timeoutMs: 5000 });
    this.caller.value = caller;
    return caller;
  }

  /** Empty: signed in. Else why not, for people. */
  async signIn(token: string, remember: boolean): Promise<string> {
    const before = this.token;
    this.token = token.trim();
    try {
      const caller = await this.refresh();
      if (caller.role < Role.VIEWER) {
        this.token = before;
        return "The server does not know this token.";
      }
    } catch (error) {
      this.token = before;
      return messageOf(error);
    }
    sessionStorage.setItem(TOKEN_KEY, this.token);
    if (remember) localStorage.setItem(TOKEN_KEY, this.token);
    this.generation.value++;
    return "";
  }

  signOut(): void {
    this.token = "";
    sessionStorage.removeItem(TOKEN_KEY);
    localStorage.removeItem(TOKEN_KEY);
    this.caller.value = undefined;
    this.generation.value++;
  }
}

/** Calls go to where the page came from, which a proxy may have put below a path of its own. */
export function callBase(page: string): string {
  return new URL(".", page).href;
}

/** An error in words for people. */
export function messageOf(error: unknown): string {
  const trouble = ConnectError.from(error);
  if (trouble.code === Code.Unknown && /fetch|network/i.test(trouble.rawMessage))
    return "The server does not answer.";
  return trouble.rawMessage || "The server does not answer.";
}
