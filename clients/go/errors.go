package stellate

import (
	"errors"
	"fmt"
	"strings"

	"google.golang.org/grpc/codes"
	"google.golang.org/grpc/status"
	"google.golang.org/protobuf/proto"

	rpc "stellate/proto/rpc"
)

// Kinds of errors, for errors.Is.
var (
	// ErrInvalidArgument: a specification that makes no sense. Mend the field that the message names.
	ErrInvalidArgument = errors.New("invalid argument")
	// ErrLimitExceeded: more than the server is willing to do.
	ErrLimitExceeded = errors.New("limit exceeded")
	// ErrMeshNotFound: the name is misspelt, or the mesh was deleted.
	ErrMeshNotFound = errors.New("mesh not found")
	// ErrFailedPrecondition: a call out of order, such as serving a mesh that is over.
	ErrFailedPrecondition = errors.New("failed precondition")
	// ErrUnauthenticated: the server wants a token, and got none that it knows.
	ErrUnauthenticated = errors.New("unauthenticated")
	// ErrOracle: the oracle's answers break a rule, or the mesh got none. Mend the oracle.
	ErrOracle = errors.New("oracle error")
	// ErrCancelled: the mesh was cancelled, by its context or by somebody else.
	ErrCancelled = errors.New("cancelled")
	// ErrUnavailable: the server cannot be reached, or is stopping.
	ErrUnavailable = errors.New("unavailable")
	// ErrServerNotFound: no server was given, and there is no stellated on this machine to start.
	ErrServerNotFound = errors.New("no stellated found")
	// ErrSave: a mesh that the chosen file format cannot hold.
	ErrSave = errors.New("save error")
	// ErrNotCertified: the mesh is finished and not proved good, which Options.RequireCertified is about.
	ErrNotCertified = errors.New("not certified")
	// ErrOther is every other error of the server, its own faults among them.
	ErrOther = errors.New("stellate error")
)

// Error is every error of this package. What an oracle returns is none: it reaches the caller as itself.
type Error struct {
	Kind    error             // one of the above, which errors.Is finds
	Reason  string            // stable, e.g. "ORACLE_NOT_FINITE"; see errors.proto
	Message string            // for people
	Fields  map[string]string // what is wrong with which field of a request
	Details map[string]string // what else is known, e.g. the "limit" that is exceeded
	Mesh    *Mesh             // the unfinished mesh as far as it came, where there is one
	Cause   error             // what is behind it, e.g. context.Canceled
}

func (e *Error) Error() string { return "stellate: " + e.Message }

// Unwrap gives the kind and the cause.
func (e *Error) Unwrap() []error {
	if e.Cause == nil {
		return []error{e.Kind}
	}
	return []error{e.Kind, e.Cause}
}

func newError(kind error, reason, format string, values ...any) *Error {
	return &Error{Kind: kind, Reason: reason, Message: fmt.Sprintf(format, values...)}
}

func invalid(format string, values ...any) *Error {
	return newError(ErrInvalidArgument, "INVALID_ARGUMENT", format, values...)
}

func protocolError(err error) *Error {
	return newError(ErrOther, "PROTOCOL", "the server broke the protocol: %v", err)
}

const domain = "stellate.v1" // others stand between us and the server

var kindOfReason = map[string]error{
	"INVALID_ARGUMENT":    ErrInvalidArgument,
	"OUT_OF_ORDER":        ErrFailedPrecondition,
	"LIMIT_EXCEEDED":      ErrLimitExceeded,
	"MESH_NOT_FOUND":      ErrMeshNotFound,
	"FAILED_PRECONDITION": ErrFailedPrecondition,
	"SHUTTING_DOWN":       ErrUnavailable,
	"UNAUTHENTICATED":     ErrUnauthenticated,
	"REVISION_TOO_NEW":    ErrInvalidArgument,
	"NO_SEEDS":            ErrOracle,
	"NO_WORKER":           ErrOracle,
	"ANSWER_TIMEOUT":      ErrOracle,
	"WORKERS_DISAGREE":    ErrOracle,
	"INTERNAL":            ErrOther,
	"JOURNAL_FULL":        ErrOther,
	"JOURNAL_FAILED":      ErrOther,
	"REPLAY_MISMATCH":     ErrOther,
}

var kindOfCode = map[codes.Code]error{
	codes.InvalidArgument:    ErrInvalidArgument,
	codes.OutOfRange:         ErrInvalidArgument,
	codes.ResourceExhausted:  ErrLimitExceeded,
	codes.NotFound:           ErrMeshNotFound,
	codes.PermissionDenied:   ErrUnauthenticated,
	codes.FailedPrecondition: ErrFailedPrecondition,
	codes.Unauthenticated:    ErrUnauthenticated,
	codes.Aborted:            ErrOracle,
	codes.Canceled:           ErrCancelled,
	codes.Unavailable:        ErrUnavailable,
	codes.DeadlineExceeded:   ErrUnavailable,
}

// KindOf gives the kind of error for one of the protocol's reasons.
func KindOf(reason string) error {
	if strings.HasPrefix(reason, "ORACLE_") {
		return ErrOracle
	}
	if kind, known := kindOfReason[reason]; known {
		return kind
	}
	return ErrOther
}

// fromRPC is our error for a failed call, with the reason and the fields that the server named.
func fromRPC(err error) *Error {
	said := status.Convert(err)
	ours := &Error{Kind: ErrOther, Message: said.Message(), Details: map[string]string{}}
	for _, part := range said.Proto().GetDetails() {
		switch _, kind, _ := strings.Cut(part.GetTypeUrl(), "/"); kind {
		case "google.rpc.ErrorInfo":
			var info rpc.ErrorInfo
			if proto.Unmarshal(part.GetValue(), &info) == nil && info.GetDomain() == domain {
				ours.Reason, ours.Details = info.GetReason(), info.GetMetadata()
				ours.Kind = KindOf(ours.Reason)
			}
		case "google.rpc.BadRequest":
			var request rpc.BadRequest
			if proto.Unmarshal(part.GetValue(), &request) == nil {
				ours.Fields = map[string]string{}
				for _, violation := range request.GetFieldViolations() {
					ours.Fields[violation.GetField()] = violation.GetDescription()
				}
			}
		}
	}
	if _, known := kindOfReason[ours.Reason]; !known && ours.Kind == ErrOther { // of a newer server
		if kind, known := kindOfCode[said.Code()]; known {
			ours.Kind = kind
		}
	}
	if ours.Reason == "" {
		ours.Reason = strings.ToUpper(strings.ReplaceAll(ours.Kind.Error(), " ", "_"))
	}
	if ours.Message == "" {
		ours.Message = said.Code().String()
	}
	if ours.Kind == ErrUnauthenticated {
		ours.Message += "; give a token with the Connection's Credentials"
	}
	return ours
}
