package stellate

import (
	"context"
	"errors"
	"fmt"
	"io"
	"strings"
	"sync"
	"time"

	"google.golang.org/grpc"

	pb "stellate/proto/v1"
)

const (
	answerBytes  = 3_000_000 // an answer has to stay below the server's 4 MB
	messageBytes = 4000
	busyShare    = 0.25 // of the time that the server bears silence
)

// WorkerOptions say how a worker serves; all may be left out.
type WorkerOptions struct {
	Worker   string // its name, for logs
	MaxChunk int    // most points in one call of the oracle; default: the server decides
}

// Serve is one more worker for a mesh: it answers the server's questions until the mesh is over, and
// returns the state that it ended in, e.g. "SUCCEEDED". Errors of the oracle are returned as they are,
// after the server has it, too. With its context this worker leaves; its work goes to others.
func (c *Client) Serve(ctx context.Context, oracle Oracle, name string, options WorkerOptions) (string, error) {
	checked, err := check(oracle)
	if err != nil {
		return "", err
	}
	w := c.newWorker(checked, name, options)
	return w.run(ctx)
}

type worker struct {
	client    *Client
	oracle    *checkedOracle
	hello     *pb.Hello
	outage    *outage
	onFailure func(error) bool // gets what the oracle returned; says whether the server does
}

func (c *Client) newWorker(oracle *checkedOracle, name string, options WorkerOptions) *worker {
	most := max(1, answerBytes/(8*(oracle.d*(oracle.k+1+min(oracle.k, oracle.walls))+oracle.walls)+9))
	if options.MaxChunk > 0 {
		most = min(most, options.MaxChunk)
	}
	hello := &pb.Hello{Mesh: name, Worker: options.Worker, MaxChunkQueries: uint32(most)}
	return &worker{client: c, oracle: oracle, hello: hello, outage: c.outage(), onFailure: func(error) bool { return true }}
}

func (w *worker) run(ctx context.Context) (string, error) {
	for {
		state, err := w.serve(ctx)
		var broken *lost
		if !errors.As(err, &broken) {
			return state, err
		}
		ours := fromRPC(broken.err)
		if errors.Is(ours, ErrFailedPrecondition) { // it ended before this worker came, or while it was away
			if state := w.howItEnded(ctx); state != "" {
				return state, nil
			}
		}
		if err := w.outage.wait(ctx, broken.err, ours); err != nil {
			return "", err
		}
	}
}

// howItEnded is the state of a mesh that takes no more workers; "" if that cannot be found out.
func (w *worker) howItEnded(ctx context.Context) string {
	for range 300 {
		mesh, err := w.client.Get(ctx, w.hello.GetMesh())
		if err != nil {
			return ""
		}
		if mesh.GetEndTime() != nil {
			return strings.TrimPrefix(mesh.GetState().String(), "MESH_STATE_")
		}
		select { // it is just about to end
		case <-ctx.Done():
			return ""
		case <-time.After(100 * time.Millisecond):
		}
	}
	return ""
}

// outbox sends from several goroutines, and says now and then that the oracle is at a chunk, so that the
// server does not take a slow worker for a dead one. What cannot be sent shows when the stream is read.
type outbox struct {
	mutex  sync.Mutex
	stream grpc.BidiStreamingClient[pb.ServeOracleRequest, pb.ServeOracleResponse]
	busy   uint64 // the lease, or 0
}

func (o *outbox) put(request *pb.ServeOracleRequest, busyWith uint64) {
	o.mutex.Lock()
	defer o.mutex.Unlock()
	o.busy = busyWith
	if request != nil {
		_ = o.stream.Send(request)
	}
}

func (o *outbox) end() {
	o.mutex.Lock()
	defer o.mutex.Unlock()
	o.busy = 0
	_ = o.stream.CloseSend()
}

func (o *outbox) sayBusy(ctx context.Context, every time.Duration) {
	ticker := time.NewTicker(every)
	defer ticker.Stop()
	for {
		select {
		case <-ctx.Done():
			return
		case <-ticker.C:
			o.mutex.Lock()
			if o.busy != 0 {
				busy := &pb.ServeOracleRequest_Busy{Busy: &pb.Busy{Lease: o.busy}}
				_ = o.stream.Send(&pb.ServeOracleRequest{Message: busy})
			}
			o.mutex.Unlock()
		}
	}
}

func (w *worker) serve(ctx context.Context) (string, error) {
	ctx, cancel := context.WithCancel(ctx)
	defer cancel()
	stream, err := w.client.stub.ServeOracle(ctx)
	if err != nil {
		return "", &lost{err}
	}
	out := &outbox{stream: stream}
	out.put(&pb.ServeOracleRequest{Message: &pb.ServeOracleRequest_Hello{Hello: w.hello}}, 0)
	state, failed, teller := "", error(nil), sync.Once{}
	for {
		response, err := stream.Recv()
		switch {
		case failed != nil && err != nil: // ABORTED, as announced
			return "", failed
		case errors.Is(err, io.EOF):
			return state, nil
		case err != nil:
			return "", &lost{err}
		case failed != nil:
			continue // until the server has taken note
		}
		w.outage.heard()
		switch message := response.GetMessage().(type) {
		case *pb.ServeOracleResponse_Queries:
			out.put(nil, message.Queries.GetLease())
			failed = w.reply(out, message.Queries)
		case *pb.ServeOracleResponse_Welcome:
			if err := w.compare(message.Welcome); err != nil {
				return "", err
			}
			if every := time.Duration(busyShare * message.Welcome.GetAnswerSeconds() * float64(time.Second)); every > 0 {
				teller.Do(func() { go out.sayBusy(ctx, every) })
			}
		case *pb.ServeOracleResponse_Over:
			state = strings.TrimPrefix(message.Over.GetState(), "MESH_STATE_")
			out.end()
		}
	}
}

// reply has the oracle answer, and sends that, or the failure, which it returns.
func (w *worker) reply(out *outbox, chunk *pb.QueryChunk) error {
	answers, err := w.oracle.answer(chunk)
	if err == nil {
		out.put(&pb.ServeOracleRequest{Message: &pb.ServeOracleRequest_Answers{Answers: answers}}, 0)
		return nil
	}
	if !w.onFailure(err) {
		out.end() // as a worker that has to go
		return err
	}
	said := err.Error()
	if len(said) > messageBytes {
		said = said[:messageBytes]
	}
	failure := &pb.OracleFailure{Lease: chunk.GetLease(), Message: strings.ToValidUTF8(said, "")}
	out.put(&pb.ServeOracleRequest{Message: &pb.ServeOracleRequest_Failure{Failure: failure}}, 0)
	out.end()
	return err
}

// compare leaves the mesh alone if this oracle is not of its kind.
func (w *worker) compare(welcome *pb.Welcome) error {
	k, d := int(welcome.GetDimension()), int(welcome.GetAmbientDimension())
	asked, able := welcome.GetOracle(), w.oracle.capabilities
	var missing []string
	for name, lacks := range map[string]bool{
		"IntersectFlat": asked.GetIntersectFlat() && !able.GetIntersectFlat(),
		"TangentBasis":  asked.GetTangentBasis() && !able.GetTangentBasis(),
		"LocalSize":     asked.GetLocalSize() && !able.GetLocalSize(),
	} {
		if lacks {
			missing = append(missing, name)
		}
	}
	problem := ""
	switch {
	case k != w.oracle.k || d != w.oracle.d:
		problem = fmt.Sprintf("the mesh has dimension %d in R^%d, and this oracle's manifold has dimension %d in R^%d",
			k, d, w.oracle.k, w.oracle.d)
	case int(welcome.GetWalls()) != w.oracle.walls:
		problem = fmt.Sprintf("the mesh has %d walls, and this oracle's manifold has %d", welcome.GetWalls(), w.oracle.walls)
	case len(missing) > 0:
		problem = "the mesh was declared with methods that this oracle lacks: " + strings.Join(missing, ", ")
	default:
		return nil
	}
	return invalid("%s: all workers of a mesh have to serve one manifold", problem)
}
