package stellate

import (
	"bytes"
	"context"
	"errors"
	"fmt"
	"io"
	"io/fs"
	"os"
	"path/filepath"
	"strconv"
	"strings"
	"syscall"
	"time"

	"google.golang.org/protobuf/proto"

	"stellate/proto/shared"
	pb "stellate/proto/v1"
)

// checkpoint is a directory in which one mesh outlives the processes that make it, laid out as
// clients/shared/checkpoint.toml says. Only what this user put there is read, and no link is followed.
type checkpoint struct{ folder string }

func (c checkpoint) record() string { return filepath.Join(c.folder, shared.CheckpointRecord) }

// server starts the private server, once that of a killed process has come to its end.
func (c checkpoint) server() (*Server, error) {
	if err := os.MkdirAll(c.folder, 0o700); err != nil {
		return nil, invalid("the checkpoint has to be a directory: %v", err)
	}
	if err := c.insistOnOwn(); err != nil {
		return nil, err
	}
	if _, err := os.Stat(filepath.Join(c.folder, shared.CheckpointPythonRecord)); err == nil {
		return nil, invalid("%s is a checkpoint of the Python client: take another directory", c.folder)
	}
	data := filepath.Join(c.folder, shared.CheckpointServer)
	flags := []string{"--data-dir", data, "--keep-finished-seconds", strconv.Itoa(shared.CheckpointKeepFinishedSeconds)}
	for deadline := time.Now().Add(shared.CheckpointLastServerSeconds * time.Second); ; time.Sleep(100 * time.Millisecond) {
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

// insistOnOwn fails where others could have put there what we would believe.
func (c checkpoint) insistOnOwn() error {
	found, err := os.Lstat(filepath.Clean(c.folder)) // "link/" would be followed
	if err != nil {
		return err
	}
	if found.Mode()&fs.ModeSymlink != 0 {
		return invalid("the checkpoint %s is a link: name the directory that it leads to", c.folder)
	}
	if !owned(found) {
		return invalid("the checkpoint %s belongs to another user: take another directory", c.folder)
	}
	if found.Mode().Perm()&0o022 != 0 {
		return invalid("the checkpoint %s may be written by others (mode %04o): take another directory, or, "+
			"if all in it is yours, chmod go-w", c.folder, found.Mode().Perm())
	}
	return nil
}

func owned(found fs.FileInfo) bool {
	stat, ok := found.Sys().(*syscall.Stat_t)
	return ok && int(stat.Uid) == os.Geteuid()
}

// readOwn reads a file of this user's, no link and no pipe.
func readOwn(path string) ([]byte, error) {
	// NONBLOCK: a pipe without another end would wait for it.
	file, err := os.OpenFile(path, os.O_RDONLY|syscall.O_NOFOLLOW|syscall.O_NONBLOCK, 0)
	if errors.Is(err, syscall.ELOOP) {
		return nil, invalid("%s is a link, which no checkpoint has: remove it", path)
	}
	if err != nil {
		return nil, err
	}
	defer file.Close()
	found, err := file.Stat()
	if err != nil {
		return nil, err
	}
	if !found.Mode().IsRegular() || !owned(found) {
		return nil, invalid("%s is no file of this user's: take another directory", path)
	}
	return io.ReadAll(file)
}

// declare gives the mesh that is there, or a new one.
func (c checkpoint) declare(ctx context.Context, client *Client, spec *pb.MeshSpec) (*pb.Mesh, error) {
	essence := proto.Clone(spec).(*pb.MeshSpec)
	essence.Label = ""
	kept, err := readOwn(c.record())
	if err != nil && !errors.Is(err, fs.ErrNotExist) {
		return nil, err
	}
	first, there, _ := bytes.Cut(kept, []byte("\n"))
	name, _, _ := bytes.Cut(first, []byte(" ")) // what may follow is of clients that choose epsilon
	same := func() bool {
		var spec pb.MeshSpec
		return proto.Unmarshal(there, &spec) == nil && proto.Equal(&spec, essence)
	}
	if len(kept) > 0 && !same() {
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
	wanted, err := proto.Marshal(essence)
	if err != nil {
		return nil, err
	}
	return found, c.note(fmt.Appendf(nil, "%s\n%s", found.GetName(), wanted))
}

// note writes the record, all of it or nothing.
func (c checkpoint) note(record []byte) error {
	draft := filepath.Join(c.folder, shared.CheckpointDraft)
	// One of a process that was killed; a link itself, not where it leads.
	if err := os.Remove(draft); err != nil && !errors.Is(err, fs.ErrNotExist) {
		return err
	}
	file, err := os.OpenFile(draft, os.O_WRONLY|os.O_CREATE|os.O_EXCL, 0o600)
	if err != nil {
		return err
	}
	_, err = file.Write(record)
	if err := errors.Join(err, file.Close()); err != nil {
		return err
	}
	return os.Rename(draft, c.record())
}

// forgetAfter has the next call begin from the start where this mesh has failed for good.
func (c checkpoint) forgetAfter(failure error) {
	var ours *Error
	over := errors.As(failure, &ours) && ours.Mesh != nil && ours.Mesh.Report != nil
	if over && !strings.HasPrefix(ours.Reason, "JOURNAL_") { // with more room that one goes on
		_ = os.Remove(c.record())
	}
}
