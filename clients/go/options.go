package stellate

import (
	"time"

	"google.golang.org/grpc"

	pb "stellate/proto/v1"
)

// Connection says where the server is, and how to reach it; all may be left out.
type Connection struct {
	Server      string  // "host:port" or "unix:/path"
	Own         *Server // or a server of yours
	Client      *Client // or a connection that there is
	Credentials Credentials
	// Reconnect is how long a server that was there and went away is waited for; below zero: not at
	// all. Default 3 minutes.
	Reconnect time.Duration
	// OnOutage is called when the server is lost and when it is back. Default: the log package.
	OnOutage func(string)
	// DialOptions are gRPC's, beside our own: grpc.WithStatsHandler(otelgrpc.NewClientHandler()) has the
	// spans of a server go on in the trace that the context is at.
	DialOptions []grpc.DialOption
}

// Options are all that is asked of a mesh beside its oracle and epsilon; nil asks for nothing. Zero
// values stand for the defaults of mesh.proto, which says what each means.
type Options struct {
	Connection

	SizeRate, MaxDeviation float64 // adaptive size
	Reach                  float64 // a promise: M's reach is at least this
	CoverBox               bool
	Components             uint32
	MaxVertices, MaxRounds uint64
	RandomSeed             uint64
	Label                  string
	ThoroughAudit          bool
	// Spec, if there is one, changes the rest of the specification before it is sent.
	Spec func(*pb.MeshSpec)

	Workers          int // streams that call the oracle in parallel; default 1
	MaxChunk         int // most points in one call of the oracle; default: the server decides
	RequireCertified bool
	// Checkpoint is a directory, made if it is not there, in which the mesh outlives this program: the same
	// call goes on from where the last one was interrupted or killed, or its oracle failed, and gives a mesh
	// that is finished immediately. For private servers; one that is named keeps its meshes with --data-dir.
	Checkpoint string
	OnProgress func(*pb.Progress)
}

func positive[Number float64 | uint32 | uint64](value Number) *Number {
	if value == 0 {
		return nil
	}
	return &value
}

// meshSpec is the specification of a mesh. Ranges are the server's to check.
func meshSpec(c *checkedOracle, epsilon float64, o *Options, far bool) *pb.MeshSpec {
	spec := &pb.MeshSpec{
		Dimension: uint32(c.k), AmbientDimension: uint32(c.d), Epsilon: epsilon, Oracle: c.capabilities,
		Criteria:   &pb.Criteria{SizeRate: positive(o.SizeRate), MaxDeviation: positive(o.MaxDeviation)},
		Limits:     &pb.MeshLimits{MaxVertices: o.MaxVertices, MaxRounds: o.MaxRounds},
		RandomSeed: o.RandomSeed, Label: o.Label, Components: o.Components, CoverBox: o.CoverBox,
		Walls:         uint32(c.walls),
		DeclaredReach: positive(o.Reach),
	}
	if far { // round trips are what a far server costs
		spec.Criteria.Speculative = &far
	}
	if o.ThoroughAudit {
		spec.Audit = pb.Audit_AUDIT_THOROUGH
	}
	if bounded, is := c.oracle.(Bounded); is {
		lower, upper := bounded.BoundingBox()
		spec.BoundingBox = &pb.BoundingBox{Lower: toWire(lower, len(lower)), Upper: toWire(upper, len(upper))}
	}
	if seeded, is := c.oracle.(Seeded); is {
		seeds := seeded.Seeds()
		spec.Seeds = toWire(seeds, len(seeds)/c.d, c.d)
	}
	if o.Spec != nil {
		o.Spec(spec)
	}
	return spec
}
