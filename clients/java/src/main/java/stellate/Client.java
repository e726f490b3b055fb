package stellate;

import io.grpc.ChannelCredentials;
import io.grpc.Context;
import io.grpc.ManagedChannel;
import io.grpc.StatusRuntimeException;
import io.grpc.netty.shaded.io.grpc.netty.NettyChannelBuilder;
import io.grpc.netty.shaded.io.netty.channel.EventLoopGroup;
import io.grpc.netty.shaded.io.netty.channel.epoll.EpollDomainSocketChannel;
import io.grpc.netty.shaded.io.netty.channel.epoll.EpollEventLoopGroup;
import io.grpc.netty.shaded.io.netty.channel.unix.DomainSocketAddress;
import java.security.SecureRandom;
import java.util.ArrayList;
import java.util.HexFormat;
import java.util.Iterator;
import java.util.List;
import java.util.concurrent.TimeUnit;
import java.util.function.Consumer;
import java.util.function.Function;
import java.util.function.Predicate;
import java.util.function.Supplier;
import java.util.logging.Level;
import java.util.logging.Logger;
import stellate.v1.CancelMeshRequest;
import stellate.v1.CheckReport;
import stellate.v1.CreateMeshRequest;
import stellate.v1.DeleteMeshRequest;
import stellate.v1.ExamineRequest;
import stellate.v1.ExamineResponse;
import stellate.v1.GetMeshRequest;
import stellate.v1.GetServerInfoRequest;
import stellate.v1.ListMeshesRequest;
import stellate.v1.ListMeshesResponse;
import stellate.v1.MeshSpec;
import stellate.v1.ServerInfo;
import stellate.v1.StellateGrpc;

/** A connection to a server; any thread may use it. The service, call by call. */
public final class Client implements AutoCloseable {
  private static final int CALL_SECONDS = (int) Shared.RECONNECT.number("call");
  private static final long CONNECT_MILLIS = (long) (1000 * Shared.RECONNECT.number("connect"));
  private static final int LARGEST_MESSAGE = 64 << 20;

  // grpc-java sets an option that unix sockets do not have, and Netty warns of it.
  private static final Logger NETTY = Logger.getLogger("io.grpc.netty.shaded.io.netty.bootstrap");

  private static final int WINDOW = 4 << 20; // so that the next chunk comes while one is answered

  final Outage.Patience patience = new Outage.Patience();
  final StellateGrpc.StellateStub stub;
  private final StellateGrpc.StellateBlockingStub blocking;
  private final String address;
  private final ManagedChannel channel;
  private EventLoopGroup loop;

  /** To "host:port" or "unix:/path". */
  public Client(String server, Credentials credentials) {
    this(server, credentials, (long) Shared.RECONNECT.number("keepalive"));
  }

  /** To a server of one's own. */
  public Client(Server server) {
    this(server.address(), Credentials.NONE, 0); // its end shows immediately
    patience.hopeless = server::whyGone;
  }

  /** A silent server is pinged after the seconds, 0: never, and has twice as long to answer. */
  public Client(String server, Credentials credentials, long keepaliveSeconds) {
    if (!server.matches("unix:.*|[^/]*:[0-9]+")) {
      throw StellateException.invalid("server has to be host:port or unix:/path: " + server);
    }
    address = server;
    ChannelCredentials security = credentials.channel(server);
    NettyChannelBuilder builder;
    if (server.startsWith("unix:")) {
      NETTY.setLevel(Level.SEVERE);
      loop = new EpollEventLoopGroup(1);
      builder =
          NettyChannelBuilder.forAddress(
                  new DomainSocketAddress(server.substring("unix:".length())), security)
              .eventLoopGroup(loop)
              .channelType(EpollDomainSocketChannel.class, DomainSocketAddress.class)
              .overrideAuthority("localhost");
    } else {
      builder = NettyChannelBuilder.forTarget("dns:///" + server, security);
    }
    if (keepaliveSeconds > 0) {
      builder
          .keepAliveTime(keepaliveSeconds, TimeUnit.SECONDS)
          .keepAliveTimeout(
              (long) (Shared.RECONNECT.number("ping_patience") * keepaliveSeconds),
              TimeUnit.SECONDS)
          .keepAliveWithoutCalls(true);
    }
    if (Credentials.staysOnThisMachine(server)) {
      builder.proxyDetector(to -> null); // proxies are for the outside
    }
    channel =
        builder
            .initialFlowControlWindow(WINDOW)
            .maxInboundMessageSize(LARGEST_MESSAGE)
            .defaultServiceConfig(Shared.retries()) // a reply that was lost on the way
            .intercept(credentials.interceptor())
            .build();
    stub = StellateGrpc.newStub(channel);
    blocking = StellateGrpc.newBlockingStub(channel);
    patience.connect = this::connect;
  }

  /**
   * How long a server that was there and went away is waited for; 0: not at all. Default: of
   * clients/shared.
   */
  public Client reconnectSeconds(double seconds) {
    patience.giveUpSeconds = seconds;
    return this;
  }

  /** Called when the server is lost and when it is back. Default: standard error. */
  public Client onOutage(Consumer<String> told) {
    patience.onOutage = told;
    return this;
  }

  /** Waits a moment for a connection; what is wrong the next attempt will tell. */
  private void connect() {
    channel.resetConnectBackoff(); // the pauses between attempts are ours
    try {
      StellateGrpc.StellateBlockingStub soon = blocking.withWaitForReady();
      GetServerInfoRequest ask = GetServerInfoRequest.getDefaultInstance();
      ServerInfo unused =
          soon.withDeadlineAfter(CONNECT_MILLIS, TimeUnit.MILLISECONDS).getServerInfo(ask);
      patience.reached |= unused.getMaxMeshes() >= 0;
    } catch (StatusRuntimeException error) {
      return;
    }
  }

  Outage outage() {
    return new Outage(patience, false);
  }

  private <R> R call(Outage outage, Function<StellateGrpc.StellateBlockingStub, R> method) {
    while (true) {
      try {
        R reply = method.apply(blocking.withDeadlineAfter(CALL_SECONDS, TimeUnit.SECONDS));
        outage.heard();
        return reply;
      } catch (StatusRuntimeException error) {
        outage.await(error);
      }
    }
  }

  private Outage once() {
    Outage outage = outage();
    outage.stop();
    return outage;
  }

  /**
   * Declares a mesh, which waits to be served. Repeated when the server is lost: an id of its own
   * lets the server know the mesh again.
   */
  public stellate.v1.Mesh create(Oracle oracle, double epsilon, Options options) {
    return create(spec(new CheckedOracle(oracle), epsilon, options));
  }

  MeshSpec spec(CheckedOracle oracle, double epsilon, Options options) {
    return options.specOf(oracle, epsilon, !Credentials.staysOnThisMachine(address));
  }

  stellate.v1.Mesh create(MeshSpec spec) {
    byte[] id = new byte[16];
    new SecureRandom().nextBytes(id);
    CreateMeshRequest request =
        CreateMeshRequest.newBuilder()
            .setSpec(spec)
            .setMeshId(HexFormat.of().formatHex(id))
            .build();
    return call(outage(), now -> now.createMesh(request));
  }

  /** A mesh as it stands, without its geometry. */
  public stellate.v1.Mesh get(String name) {
    GetMeshRequest request = GetMeshRequest.newBuilder().setName(name).build();
    return call(outage(), now -> now.getMesh(request));
  }

  /** All meshes, oldest first, fetched page by page. */
  public List<stellate.v1.Mesh> list() {
    List<stellate.v1.Mesh> all = new ArrayList<>();
    String token = "";
    do {
      ListMeshesRequest request = ListMeshesRequest.newBuilder().setPageToken(token).build();
      ListMeshesResponse page = call(outage(), now -> now.listMeshes(request));
      all.addAll(page.getMeshesList());
      token = page.getNextPageToken();
    } while (!token.isEmpty());
    return all;
  }

  /** Ends a mesh; what there is of it stays readable. */
  public stellate.v1.Mesh cancel(String name) {
    CancelMeshRequest request = CancelMeshRequest.newBuilder().setName(name).build();
    return call(outage(), now -> now.cancelMesh(request));
  }

  void cancelOnce(String name) {
    CancelMeshRequest request = CancelMeshRequest.newBuilder().setName(name).build();
    stellate.v1.Mesh unused = call(once(), now -> now.cancelMesh(request));
    patience.reached |= unused.hasSpec();
  }

  /** Cancels a mesh if it runs, and forgets it. */
  public void delete(String name) {
    delete(name, outage());
  }

  void deleteOnce(String name) {
    delete(name, once());
  }

  private void delete(String name, Outage outage) {
    DeleteMeshRequest request = DeleteMeshRequest.newBuilder().setName(name).build();
    try {
      call(outage, now -> now.deleteMesh(request));
    } catch (StellateException error) {
      if (!(error.reason().equals("MESH_NOT_FOUND") && outage.lasts())) {
        throw error;
      } // else an attempt whose answer was lost has done it
    }
  }

  /** What the server is and allows. */
  public ServerInfo info() {
    return call(outage(), now -> now.getServerInfo(GetServerInfoRequest.getDefaultInstance()));
  }

  /**
   * Probes an oracle for its contract, before a mesh is made of its answers; what it throws is a
   * finding, too. epsilon: that a mesh is planned with, 0: none yet.
   */
  public CheckReport check(Oracle oracle, double epsilon) {
    MeshSpec spec = spec(new CheckedOracle(oracle), epsilon, new Options());
    ExamineRequest request = ExamineRequest.newBuilder().setSpec(spec).build();
    RuntimeException failure = null;
    try {
      Iterator<ExamineResponse> events = blocking.examine(request);
      while (events.hasNext()) {
        ExamineResponse event = events.next();
        if (event.hasMesh()) {
          failure = failureOf(() -> serve(oracle, event.getMesh().getName(), "", 0));
        } else if (event.hasReport()) {
          return event.getReport();
        }
      }
    } catch (StatusRuntimeException error) {
      throw failure == null ? StellateException.of(error) : failure; // there was no examination
    }
    throw StellateException.protocol("it ended an examination without a report");
  }

  private static RuntimeException failureOf(Runnable work) {
    try {
      work.run();
      return null;
    } catch (RuntimeException error) {
      return error;
    }
  }

  /**
   * Serves a mesh with this oracle until it is over, on this thread; the state that it ended in,
   * e.g. "SUCCEEDED". maxChunk: most points in one call of the oracle; 0: the server decides.
   */
  public String serve(Oracle oracle, String name, String worker, int maxChunk) {
    return new Worker(this, new CheckedOracle(oracle), name, worker, maxChunk, outage()).run();
  }

  /** Hands on a stream's messages, opening it again where it breaks off, until `last` says so. */
  <T> void follow(
      Context.CancellableContext within,
      Function<StellateGrpc.StellateBlockingStub, Iterator<T>> open,
      Runnable onResume,
      Predicate<T> last) {
    Outage outage = outage();
    within.addListener(context -> outage.stop(), Runnable::run);
    while (true) {
      try {
        Supplier<Iterator<T>> opening = () -> open.apply(blocking);
        Iterator<T> stream = inside(within, opening);
        while (inside(within, stream::hasNext)) {
          T message = stream.next();
          outage.heard();
          if (last.test(message)) {
            return;
          }
        }
        throw StellateException.protocol("it ended a stream too early");
      } catch (StatusRuntimeException error) {
        outage.await(error);
        onResume.run();
      }
    }
  }

  private static <T> T inside(Context context, Supplier<T> work) {
    Context before = context.attach();
    try {
      return work.get();
    } finally {
      context.detach(before);
    }
  }

  @Override
  public void close() {
    channel.shutdownNow();
    if (loop != null) {
      loop.shutdownGracefully(0, 1, TimeUnit.SECONDS);
    }
  }
}
