package stellate;

import io.grpc.CallOptions;
import io.grpc.Channel;
import io.grpc.ChannelCredentials;
import io.grpc.ClientCall;
import io.grpc.ClientInterceptor;
import io.grpc.ForwardingClientCall.SimpleForwardingClientCall;
import io.grpc.InsecureChannelCredentials;
import io.grpc.Metadata;
import io.grpc.MethodDescriptor;
import io.grpc.TlsChannelCredentials;
import java.io.IOException;
import java.nio.file.Path;

/**
 * TLS, and a token, for a server that wants them. Files are PEM; all may be null.
 *
 * @param token sent with every call; over plain text only within this machine
 * @param ca the authority that signed the server's certificate
 * @param certificate the client's own, for a server that asks for one
 * @param key its private key
 * @param tls TLS with the system's authorities; implied by ca and certificate
 */
public record Credentials(String token, Path ca, Path certificate, Path key, boolean tls) {
  /** None: plain text, no token. */
  public static final Credentials NONE = new Credentials(null, null, null, null, false);

  /** A token alone. */
  public static Credentials token(String token) {
    return new Credentials(token, null, null, null, false);
  }

  ChannelCredentials channel(String address) {
    if ((certificate == null) != (key == null)) {
      throw StellateException.invalid("a client certificate and its key go together: give both");
    }
    if (!tls && ca == null && certificate == null) {
      if (token != null && !staysOnThisMachine(address)) {
        throw StellateException.invalid(
            "the token would go to "
                + address
                + " in plain text, for others to read and use: turn TLS on");
      }
      return InsecureChannelCredentials.create();
    }
    try {
      TlsChannelCredentials.Builder builder = TlsChannelCredentials.newBuilder();
      if (ca != null) {
        builder.trustManager(ca.toFile());
      }
      if (certificate != null) {
        builder.keyManager(certificate.toFile(), key.toFile());
      }
      return builder.build();
    } catch (IOException error) {
      throw StellateException.invalid("these credentials cannot be read: " + error.getMessage());
    }
  }

  /** Sends the token; call credentials would be refused on plain text. */
  ClientInterceptor interceptor() {
    Metadata.Key<String> name = Metadata.Key.of("authorization", Metadata.ASCII_STRING_MARSHALLER);
    return new ClientInterceptor() {
      @Override
      public <Q, R> ClientCall<Q, R> interceptCall(
          MethodDescriptor<Q, R> method, CallOptions options, Channel next) {
        return new SimpleForwardingClientCall<>(next.newCall(method, options)) {
          @Override
          public void start(Listener<R> listener, Metadata headers) {
            if (token != null) {
              headers.put(name, "Bearer " + token);
            }
            super.start(listener, headers);
          }
        };
      }
    };
  }

  static boolean staysOnThisMachine(String address) {
    return address.matches("unix:.*|(localhost|\\[::1\\]|127(\\.\\d+){3}):\\d+");
  }

  /** Without the token. */
  @Override
  public String toString() {
    return "Credentials[ca=%s, certificate=%s, tls=%b]".formatted(ca, certificate, tls);
  }
}
