package stellate

import (
	"bytes"
	"context"
	"errors"
	"fmt"
	"io/fs"
	"os"
	"path/filepath"
	"strings"
	"time"

	"google.golang.org/protobuf/proto"

	pb "stellate/proto/v1"
)

// lastServer is how long the server of a process that was killed may take to end.
const lastServer = 20 * time.Second

// checkpoint is a directory in which one mesh outlives the processes that make it:
//
//	mesh     the mesh's name on the private server, and, on the next line, what is meshed
//	server/  that server's --data-dir
type checkpoint struct{ folder string }

func (c checkpoint) record() string { return filepath.Join(c.folder, "mesh") }

// server starts the private server, once that of a killed process has come to its end.
func (c checkpoint) server() (*Server, error) {
	if _, err := os.Stat(filepath.Join(c.folder, "mesh.json")); err == nil {
		return nil, invalid("%s is a checkpoint of the Python client: take another directory", c.folder)
	}
	data := filepath.Join(c.folder, "server")
	if err := os.MkdirAll(c.folder, 0o700); err != nil {
		return nil, invalid("the checkpoint has to be a directory: %v", err)
	}
	flags := []string{"--data-dir", data, "--keep-finished-seconds", "31536000"}
	for deadline := time.Now().Add(lastServer); ; time.Sleep(100 * time.Millisecond) {
		server, err := StartServer(ServerOptions{Flags: flags})
		switch {
		case err == nil || !strings.Contains(err.Error(), "another server uses"):
			return server, err
		case time.Now().After(deadline):
			return nil, newError(ErrFailedPrecondition, "FAILED_PRECONDITION", "another process is meshing in the "+
				"checkpoint %s: wait for its end, or take another directory", c.folder)
		}
	}
}

// declare gives the mesh that is there, or a new one.
func (c checkpoint) declare(ctx context.Context, client *Client, spec *pb.MeshSpec) (*pb.Mesh, error) {
	essence := proto.Clone(spec).(*pb.MeshSpec)
	essence.Label = ""
	wanted, err := proto.MarshalOptions{Deterministic: true}.Marshal(essence)
	if err != nil {
		return nil, err
	}
	kept, err := os.ReadFile(c.record())
	if err != nil && !errors.Is(err, fs.ErrNotExist) {
		return nil, err
	}
	name, there, _ := bytes.Cut(kept, []byte("\n"))
	if len(kept) > 0 && !bytes.Equal(there, wanted) {
		return nil, invalid("the checkpoint %s is of a mesh of another specification: take another directory, or "+
			"remove it", c.folder)
	}
	var found *pb.Mesh
	for info, err := range client.List(ctx) {
		switch {
		case err != nil:
			return nil, err
		case info.GetName() == string(name):
			found = info
		default: // it was forgotten, or never put down
			if err := client.Delete(ctx, info.GetName()); err != nil {
				return nil, err
			}
		}
	}
	if found != nil {
		return found, nil
	}
	if found, err = client.create(ctx, spec); err != nil {
		return nil, err
	}
	return found, c.note(fmt.Appendf(nil, "%s\n%s", found.GetName(), wanted))
}

// note writes the record, all of it or nothing.
func (c checkpoint) note(record []byte) error {
	if err := os.WriteFile(c.record()+".new", record, 0o600); err != nil {
		return err
	}
	return os.Rename(c.record()+".new", c.record())
}

// forgetAfter has the next call begin anew where this mesh has failed for good.
func (c checkpoint) forgetAfter(failure error) {
	var ours *Error
	over := errors.As(failure, &ours) && ours.Mesh != nil && ours.Mesh.Report != nil
	if over && !strings.HasPrefix(ours.Reason, "JOURNAL_") { // with more room that one goes on
		_ = os.Remove(c.record())
	}
}
