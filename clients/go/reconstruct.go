package stellate

import (
	"context"
	"errors"

	pb "stellate/proto/v1"
)

// ReconstructOptions are all that is asked of a mesh of points beside the points; nil asks for nothing. Zero
// values stand for the defaults of Reconstruction in mesh.proto, which says what each means.
type ReconstructOptions struct {
	Connection

	Noise *float64 // the standard deviation of each coordinate, a length; 0: exact. nil: as the points show
	Reach float64  // a promise: the manifold's reach is at least this. Exact points may then be proved
	Drop  *float64 // the share of the points that may be left out, 0 to 0.5; nil: one in a thousand
	Open  bool     // the manifold may have a boundary, and the mesh ends where the points do
	// WeightsOnly asks for the weighted tangential Delaunay complex: stars are made to agree by weights of
	// points alone, or the mesh is refused.
	WeightsOnly bool
	// Steiner lets points be added where nothing else makes stars agree: vertices after the points.
	Steiner bool
	Label   string
	// Spec, if there is one, changes the rest of the specification before it is sent.
	Spec func(*pb.Reconstruction)

	RequireCertified bool
	OnProgress       func(*pb.Progress)
}

func (o *ReconstructOptions) spec(cloud *PointCloud) *pb.Reconstruction {
	spec := &pb.Reconstruction{
		Dimension: uint32(cloud.Dimension), AmbientDimension: uint32(cloud.AmbientDimension),
		Points: uint64(cloud.count()), Tangents: cloud.Tangents != nil, Noise: o.Noise,
		DeclaredReach: positive(o.Reach), Drop: o.Drop, Open: o.Open, Label: o.Label,
		Steiner: o.Steiner,
	}
	if o.WeightsOnly {
		spec.Weights = pb.Weighting_WEIGHTING_ONLY
	}
	if o.Spec != nil {
		o.Spec(spec)
	}
	return spec
}

// Reconstruct makes a mesh of points on a manifold, or near it. Point i is vertex i of the mesh, and
// Mesh.Places says what became of it.
//
//	mesh, err := stellate.Reconstruct(ctx, stellate.PointCloud{Dimension: 2, AmbientDimension: 3, Points: points}, nil)
//
// The upload goes on where a lost server left off. When the context ends, so does the mesh: an *Error of
// kind ErrCancelled.
func Reconstruct(ctx context.Context, cloud PointCloud, options *ReconstructOptions) (*Mesh, error) {
	if options == nil {
		options = &ReconstructOptions{}
	}
	if err := cloud.check(); err != nil {
		return nil, err
	}
	client, closeAll, err := options.open()
	if err != nil {
		return nil, err
	}
	defer closeAll()
	first := &pb.PointsChunk{Message: &pb.PointsChunk_Spec{Spec: options.spec(&cloud)}}
	declared, err := client.sendPoints(ctx, first, nil)
	if err != nil { // once: whether the mesh was made would not be known
		return nil, cancelledWith(ctx, fromRPC(err))
	}
	client.patience.reached.Store(true)
	name := declared.GetMesh().GetName()
	defer client.deleteOnce(ctx, name)
	final, err := client.sendAndWatch(ctx, name, &cloud, options.OnProgress)
	if err != nil {
		return nil, cancelledWith(ctx, err)
	}
	mesh, err := client.assemble(ctx, final, 0)
	if err == nil {
		err = judge(mesh, final)
	}
	if err == nil && options.RequireCertified {
		err = insistOnCertified(mesh)
	}
	if err != nil {
		return nil, cancelledWith(ctx, err)
	}
	return mesh, nil
}

// cancelledWith is the error that the end of the context made of it, if it did.
func cancelledWith(ctx context.Context, err error) error {
	var ours *Error
	if ctx.Err() != nil && errors.As(err, &ours) {
		ours.Kind, ours.Reason, ours.Cause = ErrCancelled, "CANCELLED", ctx.Err()
		ours.Message = "the reconstruction is cancelled"
	}
	return err
}

// sendAndWatch uploads the points while it watches their mesh, and returns how that ended.
func (c *Client) sendAndWatch(ctx context.Context, name string, cloud *PointCloud,
	onProgress func(*pb.Progress)) (*pb.Mesh, error) {
	watching, leave := context.WithCancel(ctx)
	defer leave()
	sending, stop := context.WithCancel(ctx)
	uploaded := make(chan error, 1)
	go func() {
		err := c.upload(sending, name, cloud)
		if err != nil && !errors.Is(err, ErrFailedPrecondition) { // that is: it is over, as the watch says
			leave()
		}
		uploaded <- err
	}()
	var final *pb.Mesh
	request := &pb.WatchMeshRequest{Name: name, ProgressOnly: true}
	err := c.Events(watching, request, func() {}, func(event *pb.WatchMeshResponse) error {
		if progress := event.GetProgress(); progress != nil && onProgress != nil {
			onProgress(progress)
		}
		if event.GetFinal() != nil {
			final = event.GetFinal()
		}
		return nil
	})
	stop()
	refused := <-uploaded
	if final != nil || ctx.Err() != nil || watching.Err() == nil {
		return final, err
	}
	// How the mesh ended says more than why its upload was refused then.
	if now, err := c.Get(ctx, name); err == nil && now.GetEndTime() != nil {
		return now, nil
	}
	return nil, refused
}

// upload sends the points of a mesh. After a break it goes on from what the server has recorded.
func (c *Client) upload(ctx context.Context, name string, cloud *PointCloud) error {
	info, err := c.Info(ctx)
	if err != nil {
		return err
	}
	o := c.outage()
	o.quiet = true // the watch tells
	for {
		first := &pb.PointsChunk{Message: &pb.PointsChunk_Mesh{Mesh: name}}
		had, err := c.sendPoints(ctx, first, nil)
		if err == nil {
			_, err = c.sendPoints(ctx, first, func(send func(*pb.PointsChunk) error) error {
				for chunk := range cloud.chunks(int(had.GetRows()), info.GetMaxMessageBytes()) {
					if err := send(chunk); err != nil {
						return err
					}
				}
				return nil
			})
		}
		if err == nil {
			o.heard()
			return nil
		}
		if err := o.wait(ctx, err, o.explain(fromRPC(err))); err != nil {
			return err
		}
	}
}

// sendPoints is one call of Reconstruct: a first message, what `rest` sends, and the server's reply. Its
// errors are gRPC's.
func (c *Client) sendPoints(ctx context.Context, first *pb.PointsChunk,
	rest func(send func(*pb.PointsChunk) error) error) (*pb.ReconstructReply, error) {
	within, cancel := context.WithCancel(ctx)
	defer cancel()
	stream, err := c.stub.Reconstruct(within)
	if err != nil {
		return nil, err
	}
	// What fails to be sent is io.EOF: the call has ended, and the reply says how.
	if stream.Send(first) == nil && rest != nil {
		_ = rest(stream.Send)
	}
	return stream.CloseAndRecv()
}
