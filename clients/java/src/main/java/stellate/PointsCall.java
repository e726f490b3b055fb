package stellate;

import io.grpc.Status;
import io.grpc.StatusRuntimeException;
import io.grpc.stub.ClientCallStreamObserver;
import io.grpc.stub.ClientResponseObserver;
import java.util.Iterator;
import stellate.v1.PointsChunk;
import stellate.v1.ReconstructReply;

/** One call of Reconstruct. */
final class PointsCall implements ClientResponseObserver<PointsChunk, ReconstructReply> {
  private ClientCallStreamObserver<PointsChunk> requests;
  private ReconstructReply reply;
  private Status status; // null: the call goes on

  @Override
  public void beforeStart(ClientCallStreamObserver<PointsChunk> stream) {
    requests = stream;
    stream.setOnReadyHandler(this::wake);
  }

  @Override
  public synchronized void onNext(ReconstructReply said) {
    reply = said;
  }

  @Override
  public void onError(Throwable error) {
    end(Status.fromThrowable(error));
  }

  @Override
  public void onCompleted() {
    end(Status.OK);
  }

  private synchronized void end(Status now) {
    status = now;
    notifyAll();
  }

  private synchronized void wake() {
    notifyAll();
  }

  /** Sends messages no faster than they leave, and waits for the reply. */
  ReconstructReply send(Iterator<PointsChunk> chunks) throws InterruptedException {
    while (chunks.hasNext() && isReady()) {
      requests.onNext(chunks.next());
    }
    synchronized (this) {
      if (status == null) {
        requests.onCompleted();
      }
      while (status == null) {
        wait();
      }
      if (!status.isOk()) {
        throw new StatusRuntimeException(status);
      }
      return reply;
    }
  }

  /** Whether there is a call to send in, once there is room for a message. */
  private synchronized boolean isReady() throws InterruptedException {
    while (status == null && !requests.isReady()) {
      wait();
    }
    return status == null;
  }
}
