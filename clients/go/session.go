package stellate

import (
	"context"
	"errors"
	"fmt"
	"iter"
	"sync"
	"time"

	pb "stellate/proto/v1"
)

const farewell = 2 * time.Second // that a worker may take to end when no call waits for it

// open gives the connection's client, or that of a server which is started, and what is to be closed.
func (to Connection) open() (*Client, func(), error) {
	if to.Client != nil {
		return to.Client, func() {}, nil
	}
	closeOwn := func() {}
	if to.Server == "" && to.Own == nil {
		if to.Credentials != (Credentials{}) {
			return nil, nil, invalid("credentials are for a server: say which")
		}
		own, err := StartServer(ServerOptions{})
		if err != nil {
			return nil, nil, err
		}
		to.Own, closeOwn = own, func() { _ = own.Close() }
	}
	client, err := NewClient(to)
	if err != nil {
		closeOwn()
		return nil, nil, err
	}
	return client, func() { _ = client.Close(); closeOwn() }, nil
}

// NewMesh meshes the oracle's manifold. epsilon is the largest circumradius of a simplex, a length.
//
// When the context ends, so does the mesh: the error is an *Error of kind ErrCancelled with the mesh so
// far. What the oracle returns as an error comes back as it is.
func NewMesh(ctx context.Context, oracle Oracle, epsilon float64, options *Options) (*Mesh, error) {
	if options == nil {
		options = &Options{}
	}
	var finished *Mesh
	var failure error
	run(ctx, oracle, epsilon, options, false, func(mesh *Mesh, err error) bool {
		finished, failure = mesh, err
		return true
	})
	if failure != nil {
		return nil, failure
	}
	if options.RequireCertified {
		if err := insistOnCertified(finished); err != nil {
			return nil, err
		}
	}
	return finished, nil
}

func insistOnCertified(mesh *Mesh) error {
	if mesh.Certified() {
		return nil
	}
	verdict := mesh.Report.GetCertificate().GetVerdict()
	err := newError(ErrNotCertified, "NOT_CERTIFIED", "the mesh is not certified: %s", verdict)
	err.Mesh = mesh
	return err
}

// Watch gives the mesh as it grows; the last one has its report. Leaving the loop cancels the mesh.
func Watch(ctx context.Context, oracle Oracle, epsilon float64, options *Options) iter.Seq2[*Mesh, error] {
	if options == nil {
		options = &Options{}
	}
	return func(yield func(*Mesh, error) bool) { run(ctx, oracle, epsilon, options, true, yield) }
}

// Watch gives a mesh that others serve as it grows. Leaving the loop leaves it alone.
func (c *Client) Watch(ctx context.Context, name string, onProgress func(*pb.Progress)) iter.Seq2[*Mesh, error] {
	return func(yield func(*Mesh, error) bool) {
		info, err := c.Get(ctx, name)
		if err == nil {
			err = c.follow(ctx, info, onProgress, true, func(mesh *Mesh) bool { return yield(mesh, nil) })
		}
		if err != nil && !errors.Is(err, errLeft) {
			yield(nil, err)
		}
	}
}

// errLeft: no caller wants more of a mesh.
var errLeft = errors.New("left")

// follow hands on a mesh at its end, and at every revision where they are wanted. It returns how the
// mesh failed.
func (c *Client) follow(ctx context.Context, info *pb.Mesh, onProgress func(*pb.Progress), every bool,
	each func(*Mesh) bool) error {
	growth := growthOf(info.GetSpec())
	var progress *pb.Progress
	note := func(now *pb.Progress) {
		if progress = now; onProgress != nil && now != nil {
			onProgress(now)
		}
	}
	hand := func(final *pb.Mesh) error {
		made := growth.mesh
		if final != nil {
			made = growth.finished
		}
		mesh, err := made()
		if err != nil {
			return err
		}
		mesh.Progress, mesh.Report = progress, final.GetReport()
		if err := judge(mesh, final); err != nil {
			return err
		}
		if !each(mesh) {
			return errLeft
		}
		return nil
	}
	request := &pb.WatchMeshRequest{Name: info.GetName()}
	forget := func() { growth.pending = nil }
	err := c.Events(ctx, request, forget, func(event *pb.WatchMeshResponse) error {
		switch message := event.GetEvent().(type) {
		case *pb.WatchMeshResponse_Delta:
			complete, err := growth.absorb(message.Delta)
			if err != nil {
				return protocolError(err)
			}
			if complete && every {
				return hand(nil)
			}
		case *pb.WatchMeshResponse_ResetMesh:
			growth.reset()
		case *pb.WatchMeshResponse_Progress:
			note(message.Progress)
			if message.Progress.GetPhase() == pb.Phase_PHASE_CERTIFYING { // while the server is busy
				if err := growth.settle(); err != nil {
					return protocolError(err)
				}
			}
		case *pb.WatchMeshResponse_Orientation:
			if err := growth.orient(message.Orientation); err != nil {
				return protocolError(err)
			}
		case *pb.WatchMeshResponse_Final:
			note(message.Final.GetProgress())
			return hand(message.Final)
		}
		return nil
	})
	var ours *Error
	if errors.As(err, &ours) && ours.Mesh == nil {
		ours.Mesh, _ = growth.mesh()
	}
	return err
}

func judge(mesh *Mesh, final *pb.Mesh) error {
	switch final.GetState() {
	case pb.MeshState_MESH_STATE_CANCELLED:
		err := newError(ErrCancelled, "CANCELLED", "the mesh was cancelled")
		err.Mesh = mesh
		return err
	case pb.MeshState_MESH_STATE_FAILED:
		failure := final.GetReport().GetFailure()
		err := newError(KindOf(failure.GetReason()), failure.GetReason(), "%s", failure.GetMessage())
		err.Mesh = mesh
		return err
	}
	return nil
}

func run(ctx context.Context, oracle Oracle, epsilon float64, options *Options, every bool, yield func(*Mesh, error) bool) {
	err := func() error {
		checked, err := check(oracle)
		if err != nil {
			return err
		}
		kept := checkpoint{options.Checkpoint}
		to := options.Connection
		if kept.folder != "" {
			if to.Server != "" || to.Own != nil || to.Client != nil || to.Credentials != (Credentials{}) {
				return invalid("a checkpoint is for a private server: one that is named keeps meshes itself")
			}
			if to.Own, err = kept.server(); err != nil {
				return err
			}
			defer to.Own.Close()
		}
		client, closeAll, err := to.open()
		if err != nil {
			return err
		}
		defer closeAll()
		spec := meshSpec(checked, epsilon, options, !staysOnThisMachine(client.Address))
		var info *pb.Mesh
		if kept.folder != "" {
			info, err = kept.declare(ctx, client, spec)
		} else {
			info, err = client.create(ctx, spec)
		}
		if err != nil {
			return err
		}
		err = client.session(ctx, checked, info, options, every, func(mesh *Mesh) bool { return yield(mesh, nil) })
		kept.forgetAfter(err)
		return err
	}()
	if err != nil && !errors.Is(err, errLeft) {
		yield(nil, err)
	}
}

// session serves and watches a mesh side by side, and deletes it in the end, or leaves it to a checkpoint.
func (c *Client) session(ctx context.Context, oracle *checkedOracle, info *pb.Mesh, options *Options,
	every bool, hand func(*Mesh) bool) error {
	// What is left when the context ends: the mesh is cancelled, and the watch tells how it ended.
	alive, leave := context.WithCancel(context.WithoutCancel(ctx))
	defer leave()
	kept := options.Checkpoint != ""
	stop := context.AfterFunc(ctx, func() {
		if kept {
			leave()
			return
		}
		limited, cancel := context.WithTimeout(alive, callTime)
		defer cancel()
		request := &pb.CancelMeshRequest{Name: info.GetName()}
		if _, err := call(limited, c.outage(), true, request, c.stub.CancelMesh); err != nil {
			leave() // a server that is away cannot say how the mesh ends
		}
	})
	defer stop()

	serving, dismiss := context.WithCancel(alive)
	defer dismiss()
	var workers sync.WaitGroup
	var once sync.Once
	var failure error
	for i := range max(1, options.Workers) {
		w := c.newWorker(oracle, info.GetName(), WorkerOptions{Worker: fmt.Sprintf("go-%d", i+1), MaxChunk: options.MaxChunk})
		w.outage.quiet = true
		w.onFailure = func(err error) bool {
			once.Do(func() { failure = err })
			if kept {
				leave() // the mesh waits for a better oracle
			}
			return !kept
		}
		workers.Add(1)
		go func() {
			defer workers.Done()
			_, _ = w.run(serving) // what the server refuses, or its absence, the watch reports
		}()
	}
	err := c.follow(alive, info, options.OnProgress, every, hand)
	if err != nil {
		dismiss()
	}
	over := make(chan struct{})
	go func() { workers.Wait(); close(over) }()
	select {
	case <-over:
		if failure != nil && err != nil && ctx.Err() == nil {
			err = withMesh(failure, err) // our own says more than the server's account of it
		}
	case <-time.After(farewell):
	}
	dismiss()
	if !kept {
		c.deleteOnce(ctx, info.GetName())
	}
	var ours *Error
	if ctx.Err() != nil && errors.As(err, &ours) {
		ours.Kind, ours.Reason, ours.Cause = ErrCancelled, "CANCELLED", ctx.Err()
		if kept {
			ours.Message = "the mesh is kept in " + options.Checkpoint + ": the same call goes on from there"
		}
	}
	return err
}

// deleteOnce forgets a mesh of one's own, even after the context's end. Once: it ends with its server, or
// somebody else was first.
func (c *Client) deleteOnce(ctx context.Context, name string) {
	limited, cancel := context.WithTimeout(context.WithoutCancel(ctx), callTime)
	defer cancel()
	_, _ = call(limited, c.outage(), true, &pb.DeleteMeshRequest{Name: name}, c.stub.DeleteMesh)
}

func withMesh(ours, theirs error) error {
	var mine, server *Error
	if errors.As(ours, &mine) && errors.As(theirs, &server) {
		mine.Mesh = server.Mesh
	}
	return ours
}

// Download fetches a mesh that is on the server: one that is over, or, with a revision, as it was then.
func (c *Client) Download(ctx context.Context, name string, revision uint64) (*Mesh, error) {
	info, err := c.Get(ctx, name)
	if err != nil {
		return nil, err
	}
	if info.GetEndTime() == nil && revision == 0 {
		return nil, newError(ErrFailedPrecondition, "FAILED_PRECONDITION", "%s is not over: %v", name, info.GetState())
	}
	mesh, err := c.assemble(ctx, info, revision)
	if err != nil || revision > 0 {
		return mesh, err
	}
	return mesh, judge(mesh, info)
}

// assemble downloads a mesh, with the progress and report of one that is over.
func (c *Client) assemble(ctx context.Context, info *pb.Mesh, revision uint64) (*Mesh, error) {
	growth := growthOf(info.GetSpec())
	request := &pb.DownloadMeshRequest{Name: info.GetName(), Revision: revision}
	err := c.parts(ctx, request, func(part *pb.DownloadMeshResponse) error {
		growth.revision = part.GetRevision()
		points, err := numbers(part.GetPoints(), -1, growth.d)
		if err == nil {
			err = growth.addPoints(part.GetFirstVertex(), points)
		}
		if err == nil {
			err = growth.change(&pb.MeshDelta{Added: part.GetCells(),
				BoundaryVertices: part.GetBoundaryVertices(), BoundaryWalls: part.GetBoundaryWalls()})
		}
		if err == nil {
			err = growth.orientPart(part)
		}
		if err == nil {
			err = growth.addPlaces(part.GetPlaces())
		}
		if err != nil {
			return protocolError(err)
		}
		return nil
	})
	if err != nil {
		return nil, err
	}
	mesh, err := growth.downloaded()
	if err != nil || revision > 0 {
		return mesh, err
	}
	mesh.Progress, mesh.Report = info.GetProgress(), info.GetReport()
	return mesh, nil
}
