package stellate;

import com.google.protobuf.Any;
import com.google.protobuf.InvalidProtocolBufferException;
import io.grpc.Metadata;
import io.grpc.Status;
import io.grpc.StatusRuntimeException;
import java.util.HashMap;
import java.util.Map;
import java.util.Optional;
import java.util.Set;
import stellate.rpc.BadRequest;
import stellate.rpc.ErrorInfo;

/**
 * Every error of this package. What an oracle throws is none: it reaches the caller as itself, or,
 * where it is a checked exception, as the cause of one of kind RAISED.
 */
public final class StellateException extends RuntimeException {
  /** What kind of thing went wrong. */
  public enum Kind {
    /** A specification that makes no sense. Mend the field that the message names. */
    INVALID_ARGUMENT,
    /** More than the server is willing to do. Ask for less, or raise its limit. */
    LIMIT_EXCEEDED,
    /** No mesh has this name: it is misspelt, or the mesh was deleted. */
    MESH_NOT_FOUND,
    /** A call out of order, such as serving a mesh that is over. */
    FAILED_PRECONDITION,
    /** The server wants a token, and got none that it knows. */
    UNAUTHENTICATED,
    /** The oracle's answers break a rule, or the mesh got none. Mend the oracle. */
    ORACLE,
    /** The oracle threw a checked exception, the cause. */
    RAISED,
    /** The mesh was cancelled, from here or by somebody else. */
    CANCELLED,
    /** The server cannot be reached, or is stopping. */
    UNAVAILABLE,
    /** No server was given, and there is no stellated on this machine to start. */
    SERVER_NOT_FOUND,
    /** A mesh that the chosen file format cannot hold. */
    SAVE,
    /** The mesh is finished and not proved good, which requireCertified insists on. */
    NOT_CERTIFIED,
    /** Every other error of the server, its own faults among them. */
    OTHER;

    /** The kind for one of the protocol's reasons. */
    public static Kind ofReason(String reason) {
      return switch (reason) {
        case "INVALID_ARGUMENT", "REVISION_TOO_NEW" -> INVALID_ARGUMENT;
        case "OUT_OF_ORDER", "FAILED_PRECONDITION" -> FAILED_PRECONDITION;
        case "LIMIT_EXCEEDED" -> LIMIT_EXCEEDED;
        case "MESH_NOT_FOUND" -> MESH_NOT_FOUND;
        case "SHUTTING_DOWN" -> UNAVAILABLE;
        case "UNAUTHENTICATED" -> UNAUTHENTICATED;
        case "NO_SEEDS", "NO_WORKER", "ANSWER_TIMEOUT", "WORKERS_DISAGREE" -> ORACLE;
        default -> reason.startsWith("ORACLE_") ? ORACLE : OTHER;
      };
    }

    private static Kind ofCode(Status.Code code) {
      return switch (code) {
        case INVALID_ARGUMENT, OUT_OF_RANGE -> INVALID_ARGUMENT;
        case RESOURCE_EXHAUSTED -> LIMIT_EXCEEDED;
        case NOT_FOUND -> MESH_NOT_FOUND;
        case FAILED_PRECONDITION -> FAILED_PRECONDITION;
        case UNAUTHENTICATED, PERMISSION_DENIED -> UNAUTHENTICATED;
        case ABORTED -> ORACLE;
        case CANCELLED -> CANCELLED;
        case UNAVAILABLE, DEADLINE_EXCEEDED -> UNAVAILABLE;
        default -> OTHER;
      };
    }
  }

  private static final Metadata.Key<byte[]> DETAILS =
      Metadata.Key.of("grpc-status-details-bin", Metadata.BINARY_BYTE_MARSHALLER);

  private static final String DOMAIN = "stellate.v1"; // others stand between us and the server

  /** Reasons whose kind is none in particular. */
  private static final Set<String> OURS =
      Set.of("INTERNAL", "JOURNAL_FULL", "JOURNAL_FAILED", "REPLAY_MISMATCH");

  private final Kind kind;
  private final String reason;
  private final transient Map<String, String> fields = new HashMap<>();
  private final transient Map<String, String> details = new HashMap<>();
  private transient Mesh mesh;

  StellateException(Kind kind, String reason, String message, Throwable cause) {
    super(message, cause);
    this.kind = kind;
    this.reason = reason;
  }

  StellateException(Kind kind, String reason, String message) {
    this(kind, reason, message, null);
  }

  static StellateException invalid(String message) {
    return new StellateException(Kind.INVALID_ARGUMENT, "INVALID_ARGUMENT", message);
  }

  static StellateException protocol(String what) {
    return new StellateException(Kind.OTHER, "PROTOCOL", "the server broke the protocol: " + what);
  }

  /** What kind of thing went wrong. */
  public Kind kind() {
    return kind;
  }

  /** Its stable name, e.g. "ORACLE_NOT_FINITE"; see errors.proto. */
  public String reason() {
    return reason;
  }

  /** What is wrong with which field of a request. */
  public Map<String, String> fields() {
    return fields;
  }

  /** What else is known, e.g. the "limit" that is exceeded. */
  public Map<String, String> details() {
    return details;
  }

  /** The unfinished mesh as far as it came, where there is one. */
  public Optional<Mesh> mesh() {
    return Optional.ofNullable(mesh);
  }

  StellateException with(Mesh soFar) {
    if (mesh == null) {
      mesh = soFar;
    }
    return this;
  }

  /** Our exception for a failed call, with the reason and the fields that the server named. */
  public static StellateException of(StatusRuntimeException error) {
    Status status = error.getStatus();
    Metadata trailers = error.getTrailers();
    byte[] bytes = trailers == null ? null : trailers.get(DETAILS);
    ErrorInfo info = ErrorInfo.getDefaultInstance();
    BadRequest request = BadRequest.getDefaultInstance();
    try {
      if (bytes != null) {
        for (Any part : stellate.rpc.Status.parseFrom(bytes).getDetailsList()) {
          switch (part.getTypeUrl().substring(part.getTypeUrl().lastIndexOf('/') + 1)) {
            case "google.rpc.ErrorInfo" -> {
              ErrorInfo said = ErrorInfo.parseFrom(part.getValue());
              info = said.getDomain().equals(DOMAIN) ? said : info;
            }
            case "google.rpc.BadRequest" -> request = BadRequest.parseFrom(part.getValue());
            default -> {} // of a newer server
          }
        }
      }
    } catch (InvalidProtocolBufferException broken) {
      error.addSuppressed(broken);
    }
    Kind kind = Kind.ofReason(info.getReason());
    if (kind == Kind.OTHER && !OURS.contains(info.getReason())) {
      kind = Kind.ofCode(status.getCode()); // a reason of a newer server
    }
    String reason = info.getReason().isEmpty() ? status.getCode().name() : info.getReason();
    String said = status.getDescription() == null ? reason : status.getDescription();
    Throwable cause = status.getCause();
    String words = cause == null ? said : said + ": " + cause.getMessage();
    if (kind == Kind.UNAUTHENTICATED) {
      words += "; give a token with Credentials.token(...)";
    }
    StellateException ours = new StellateException(kind, reason, words, error);
    ours.details.putAll(info.getMetadataMap());
    request
        .getFieldViolationsList()
        .forEach(one -> ours.fields.put(one.getField(), one.getDescription()));
    return ours;
  }
}
