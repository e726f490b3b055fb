// How a client shows a server who it is, and makes sure of the server.
import { readFileSync } from "node:fs";
import { InvalidArgument } from "./errors.js";
import { grpc } from "./wire.js";

/** TLS, and a token, for a server that wants them. Files are PEM. */
export interface Credentials {
  /** Sent with every call. Over plain text only within this machine. */
  token?: string;
  /** File with the authority that signed the server's certificate. */
  ca?: string;
  /** Files with the client's own, for a server that asks for one. */
  certificate?: string;
  key?: string;
  /** TLS with the system's authorities; implied by `ca` and `certificate`. */
  tls?: boolean;
}

/** Throws InvalidArgument where the credentials do not go together, or with the address. */
export function channelCredentials(
  address: string,
  { token, ca, certificate, key, tls }: Credentials,
): grpc.ChannelCredentials {
  if ((certificate === undefined) !== (key === undefined)) {
    throw new InvalidArgument("a client certificate and its key go together: give both");
  }
  if (tls || ca !== undefined || certificate !== undefined) {
    const read = (path?: string) => (path === undefined ? null : readFileSync(path));
    return grpc.credentials.createSsl(read(ca), read(key), read(certificate));
  }
  if (token !== undefined && !staysOnThisMachine(address)) {
    throw new InvalidArgument(
      `the token would go to ${address} in plain text, for others to read and use: turn TLS on`,
    );
  }
  return grpc.credentials.createInsecure();
}

/** None where there is no token. */
export function tokenHeader({ token }: Credentials): Record<string, string> {
  return token === undefined ? {} : { authorization: `Bearer ${token}` };
}

/** Sends headers with every call, asked for each: of credentials gRPC would refuse them on plain text. */
export function headersInterceptor(headers: () => Record<string, string>): grpc.Interceptor {
  return (options, nextCall) =>
    new grpc.InterceptingCall(nextCall(options), {
      start(metadata, listener, next) {
        for (const [name, value] of Object.entries(headers())) metadata.set(name, value);
        next(metadata, listener);
      },
    });
}

/** Whether a server's address is a unix socket or the loopback. */
export function staysOnThisMachine(address: string): boolean {
  return /^(unix:|localhost:|\[::1\]:|127(\.\d+){3}:)/.test(address);
}
