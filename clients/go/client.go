package stellate

import (
	"context"
	"crypto/rand"
	"encoding/hex"
	"errors"
	"iter"
	"log"
	"regexp"
	"time"

	"google.golang.org/grpc"
	"google.golang.org/grpc/backoff"
	"google.golang.org/grpc/keepalive"

	"stellate/proto/shared"
	pb "stellate/proto/v1"
)

var (
	callTime    = seconds(shared.ReconnectCall)
	connectTime = seconds(shared.ReconnectConnect)
	pingTime    = max(seconds(shared.ReconnectKeepalive), 10*time.Second) // the least that grpc-go allows
	pingWait    = seconds(shared.ReconnectKeepalive * shared.ReconnectPingPatience)
)

const (
	largestMessage = 64 << 20
	streamWindow   = 4 << 20
)

var addressPattern = regexp.MustCompile(`^unix:|^[^/]*:[0-9]+$`)

// Client is a connection to a server; any goroutine may use it.
type Client struct {
	Address    string
	connection *grpc.ClientConn
	stub       pb.StellateClient
	patience   *patience
}

// NewClient connects to the server that the Connection names. There has to be one.
func NewClient(to Connection) (*Client, error) {
	address, private := to.Server, false
	if to.Own != nil {
		address, private = to.Own.Address, to.Own.private
	}
	if !addressPattern.MatchString(address) {
		return nil, invalid("the server has to be host:port or unix:/path, and is %q", address)
	}
	options, err := to.Credentials.dialOptions(address)
	if err != nil {
		return nil, err
	}
	pauses := backoff.Config{BaseDelay: seconds(shared.ReconnectFirstConnectionPause), Multiplier: 2, Jitter: 0.2,
		MaxDelay: seconds(shared.ReconnectLongestConnectionPause)}
	options = append(options,
		// So that the next chunk comes while one is answered.
		grpc.WithInitialWindowSize(streamWindow), grpc.WithInitialConnWindowSize(2*streamWindow),
		grpc.WithDefaultCallOptions(grpc.MaxCallRecvMsgSize(largestMessage), grpc.MaxCallSendMsgSize(largestMessage)),
		grpc.WithDefaultServiceConfig(shared.Retries), // a reply that was lost on the way
		grpc.WithConnectParams(grpc.ConnectParams{Backoff: pauses, MinConnectTimeout: 5 * time.Second}))
	if !private { // whose end shows immediately
		options = append(options, grpc.WithKeepaliveParams(keepalive.ClientParameters{Time: pingTime, Timeout: pingWait}))
	}
	if staysOnThisMachine(address) {
		options = append(options, grpc.WithNoProxy())
	}
	connection, err := grpc.NewClient(address, append(options, to.DialOptions...)...)
	if err != nil {
		return nil, invalid("%s: %v", address, err)
	}
	c := &Client{Address: address, connection: connection, stub: pb.NewStellateClient(connection)}
	c.patience = &patience{giveUp: to.Reconnect, onOutage: to.OnOutage, connect: c.connect,
		hopeless: func() error {
			if to.Own == nil {
				return nil
			}
			return to.Own.whyGone()
		}}
	if c.patience.giveUp == 0 {
		c.patience.giveUp = seconds(shared.ReconnectGiveUp)
	}
	if c.patience.onOutage == nil {
		c.patience.onOutage = func(said string) { log.Print("stellate: ", said) }
	}
	return c, nil
}

// Close closes the connection.
func (c *Client) Close() error { return c.connection.Close() }

// connect waits a moment for a connection; what is wrong the next attempt will tell.
func (c *Client) connect(ctx context.Context) {
	ctx, cancel := context.WithTimeout(ctx, connectTime)
	defer cancel()
	_, _ = c.stub.GetServerInfo(ctx, &pb.GetServerInfoRequest{}, grpc.WaitForReady(true))
}

// call repeats a call while the server is away, unless it is to be made once.
func call[Request, Reply any](ctx context.Context, o *outage, once bool, request *Request,
	method func(context.Context, *Request, ...grpc.CallOption) (*Reply, error)) (*Reply, error) {
	for {
		limited, cancel := context.WithTimeout(ctx, callTime)
		reply, err := method(limited, request)
		cancel()
		if err == nil {
			o.heard()
			return reply, nil
		}
		ours := fromRPC(err)
		if once {
			return nil, ours
		}
		if err := o.wait(ctx, err, ours); err != nil {
			return nil, err
		}
	}
}

func (c *Client) outage() *outage { return &outage{patience: c.patience} }

// Create declares a mesh, which waits to be served. It is repeated when the server is lost: an id of its
// own lets the server know the mesh again.
func (c *Client) Create(ctx context.Context, oracle Oracle, epsilon float64, options *Options) (*pb.Mesh, error) {
	if options == nil {
		options = &Options{}
	}
	checked, err := check(oracle)
	if err != nil {
		return nil, err
	}
	return c.create(ctx, meshSpec(checked, epsilon, options, !staysOnThisMachine(c.Address)))
}

func (c *Client) create(ctx context.Context, spec *pb.MeshSpec) (*pb.Mesh, error) {
	var id [16]byte
	if _, err := rand.Read(id[:]); err != nil {
		return nil, err
	}
	request := &pb.CreateMeshRequest{Spec: spec, MeshId: hex.EncodeToString(id[:])}
	return call(ctx, c.outage(), false, request, c.stub.CreateMesh)
}

// Get is a mesh as it stands, without its geometry.
func (c *Client) Get(ctx context.Context, name string) (*pb.Mesh, error) {
	return call(ctx, c.outage(), false, &pb.GetMeshRequest{Name: name}, c.stub.GetMesh)
}

// List has all meshes, oldest first, fetched page by page.
func (c *Client) List(ctx context.Context) iter.Seq2[*pb.Mesh, error] {
	return func(yield func(*pb.Mesh, error) bool) {
		for request := new(pb.ListMeshesRequest); ; {
			page, err := call(ctx, c.outage(), false, request, c.stub.ListMeshes)
			if err != nil {
				yield(nil, err)
				return
			}
			for _, mesh := range page.GetMeshes() {
				if !yield(mesh, nil) {
					return
				}
			}
			if request.PageToken = page.GetNextPageToken(); request.PageToken == "" {
				return
			}
		}
	}
}

// Cancel ends a mesh; what there is of it stays readable.
func (c *Client) Cancel(ctx context.Context, name string) (*pb.Mesh, error) {
	return call(ctx, c.outage(), false, &pb.CancelMeshRequest{Name: name}, c.stub.CancelMesh)
}

// Delete cancels a mesh if it runs, and forgets it.
func (c *Client) Delete(ctx context.Context, name string) error {
	o := c.outage()
	_, err := call(ctx, o, false, &pb.DeleteMeshRequest{Name: name}, c.stub.DeleteMesh)
	if errors.Is(err, ErrMeshNotFound) && o.attempts > 0 {
		return nil // an attempt whose answer was lost has done it
	}
	return err
}

// Info is what the server is and allows.
func (c *Client) Info(ctx context.Context) (*pb.ServerInfo, error) {
	return call(ctx, c.outage(), false, &pb.GetServerInfoRequest{}, c.stub.GetServerInfo)
}

// Events hands on the events of a mesh as they come, across lost connections, until the last one. Where
// one broke off, onResume says that parts of an incomplete revision will come again.
func (c *Client) Events(ctx context.Context, request *pb.WatchMeshRequest, onResume func(),
	handle func(*pb.WatchMeshResponse) error) error {
	return stream(ctx, c.outage(),
		func(ctx context.Context) (interface {
			Recv() (*pb.WatchMeshResponse, error)
		}, error) {
			return c.stub.WatchMesh(ctx, request)
		},
		onResume,
		func(event *pb.WatchMeshResponse) (bool, error) {
			if delta := event.GetDelta(); delta.GetComplete() {
				request.FromRevision = delta.GetDelta().GetRevision()
			} else if event.GetResetMesh() != nil {
				request.FromRevision = 0
			}
			return event.GetFinal() != nil, handle(event)
		})
}

// parts hands on a mesh as it was at one revision.
func (c *Client) parts(ctx context.Context, request *pb.DownloadMeshRequest, handle func(*pb.DownloadMeshResponse) error) error {
	return stream(ctx, c.outage(),
		func(ctx context.Context) (interface {
			Recv() (*pb.DownloadMeshResponse, error)
		}, error) {
			return c.stub.DownloadMesh(ctx, request)
		},
		func() {},
		func(part *pb.DownloadMeshResponse) (bool, error) {
			request.Revision, request.Position = part.GetRevision(), part.GetNextPosition()
			return part.GetComplete(), handle(part)
		})
}
