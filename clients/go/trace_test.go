package stellate_test

import (
	"context"
	"slices"
	"sync"
	"testing"

	"google.golang.org/grpc"
	"google.golang.org/grpc/metadata"
	"google.golang.org/grpc/stats"

	"stellate"
)

// sent notes what calls go out with, as gRPC tells those who instrument it.
type sent struct {
	mutex   sync.Mutex
	parents map[string][]string // by call
}

func (s *sent) TagRPC(ctx context.Context, _ *stats.RPCTagInfo) context.Context { return ctx }
func (s *sent) HandleRPC(_ context.Context, what stats.RPCStats) {
	if out, ok := what.(*stats.OutHeader); ok {
		s.mutex.Lock()
		defer s.mutex.Unlock()
		s.parents[out.FullMethod] = out.Header.Get("traceparent")
	}
}
func (s *sent) TagConn(ctx context.Context, _ *stats.ConnTagInfo) context.Context { return ctx }
func (s *sent) HandleConn(context.Context, stats.ConnStats)                       {}

func TestTheTraceOfAContextGoesOut(t *testing.T) {
	const parent = "00-4b4b4b4b4b4b4b4b4b4b4b4b4b4b4b4b-a2a2a2a2a2a2a2a2-01"
	seen := &sent{parents: map[string][]string{}}
	to := server(t)
	to.DialOptions = []grpc.DialOption{grpc.WithStatsHandler(seen)}
	ctx := metadata.AppendToOutgoingContext(context.Background(), "traceparent", parent)
	if _, err := stellate.NewMesh(ctx, torus, 0.2, &stellate.Options{Connection: to}); err != nil {
		t.Fatal(err)
	}
	seen.mutex.Lock()
	defer seen.mutex.Unlock()
	for _, call := range []string{"CreateMesh", "ServeOracle", "WatchMesh"} {
		if got := seen.parents["/stellate.v1.Stellate/"+call]; !slices.Equal(got, []string{parent}) {
			t.Errorf("%s goes out with %q", call, got)
		}
	}
}
