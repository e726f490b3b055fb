package stellate

import (
	"context"
	"errors"
	"math"
	"math/rand/v2"
	"sync/atomic"
	"time"

	"google.golang.org/grpc/codes"
	"google.golang.org/grpc/status"

	"stellate/proto/shared"
)

// seconds is a time as clients/shared has it.
func seconds(s float64) time.Duration { return time.Duration(s * float64(time.Second)) }

// transient says whether the server, or the way to it, was lost, so that the same call may succeed
// later. What a server drops arrives as CANCELLED where this side cancelled nothing.
func transient(err error) bool {
	code := status.Code(err)
	return code == codes.Unavailable || code == codes.Canceled
}

// patience is what the calls and streams of one client share.
type patience struct {
	giveUp   time.Duration
	connect  func(context.Context)
	hopeless func() error // why the server will not come back, if that is known
	onOutage func(string)
	reached  atomic.Bool // something was heard of the server: it was there
}

// outage is the attempts at one call or stream. A quiet one leaves it to others to tell.
type outage struct {
	*patience
	quiet    bool
	attempts int
	lostAt   time.Time
}

func (o *outage) tell(said string) {
	if !o.quiet {
		o.onOutage(said)
	}
}

// heard notes that the attempt brought something.
func (o *outage) heard() {
	o.reached.Store(true)
	if o.attempts > 0 {
		o.tell("the server is back after " + time.Since(o.lostAt).Round(time.Millisecond).String())
		o.attempts = 0
	}
}

// explain says what a mesh that is not there means when it was there before.
func (o *outage) explain(err *Error) *Error {
	if o.attempts > 0 && errors.Is(err, ErrMeshNotFound) {
		return newError(ErrUnavailable, err.Reason,
			"the server went away and came back without the mesh; it keeps meshes only with --data-dir")
	}
	return err
}

// wait returns nil when it is time for another attempt, and else the error to report.
func (o *outage) wait(ctx context.Context, err error, ours *Error) error {
	if ctx.Err() != nil || !transient(err) {
		return ours
	}
	if hopeless := o.hopeless(); hopeless != nil {
		return hopeless
	}
	if ours.Reason == "SHUTTING_DOWN" { // said by a server
		o.reached.Store(true)
	}
	if !o.reached.Load() {
		return ours
	}
	if o.attempts == 0 {
		o.lostAt = time.Now()
		if o.giveUp > 0 {
			o.tell("lost the server (" + ours.Message + "): trying again for up to " + o.giveUp.String())
		}
	}
	left := o.giveUp - time.Since(o.lostAt)
	if left <= 0 {
		if o.attempts > 0 {
			ours.Message += "; waited " + time.Since(o.lostAt).Round(time.Millisecond).String() + " for it"
		}
		ours.Kind = ErrUnavailable
		return ours
	}
	full := min(shared.ReconnectFirstPause*math.Pow(shared.ReconnectPauseGrowth, float64(o.attempts)),
		shared.ReconnectLongestPause)
	o.attempts++
	// Shortened at random: the clients of a server that comes back do not come all together.
	pause := seconds(full * (1 - shared.ReconnectPauseJitter*rand.Float64()))
	select {
	case <-ctx.Done():
		return ours
	case <-time.After(min(pause, left)):
	}
	o.connect(ctx)
	return nil
}

// stream opens a server's stream, again where it breaks off, and hands its messages on until done.
func stream[Message any](
	ctx context.Context,
	o *outage,
	open func(context.Context) (interface{ Recv() (*Message, error) }, error),
	onResume func(),
	handle func(*Message) (done bool, err error),
) error {
	ctx, cancel := context.WithCancel(ctx)
	defer cancel()
	for {
		err := func() error {
			messages, err := open(ctx)
			for err == nil {
				var message *Message
				if message, err = messages.Recv(); err != nil {
					break
				}
				o.heard()
				done, failed := handle(message)
				if failed != nil {
					return failed
				}
				if done {
					return nil
				}
			}
			return &lost{err}
		}()
		var broken *lost
		if !errors.As(err, &broken) {
			return err
		}
		if err := o.wait(ctx, broken.err, o.explain(fromRPC(broken.err))); err != nil {
			return err
		}
		onResume()
	}
}

// lost marks what broke a stream; kept apart from what handling its messages may return.
type lost struct{ err error }

func (l *lost) Error() string { return l.err.Error() }
