// Conform obeys tests/languages/conform.py: see there.
package main

import (
	"context"
	"errors"
	"fmt"
	"log"
	"os"
	"strings"

	"stellate"
	pb "stellate/proto/v1"
)

// name is an enumerator without its prefix, or UNKNOWN, which a newer server's is.
func name[Enum ~int32](value Enum, known map[int32]string, prefix string) string {
	if said, is := known[int32(value)]; is {
		return strings.TrimPrefix(said, prefix)
	}
	return "UNKNOWN"
}

func obey(client *stellate.Client, command, what, path string) string {
	ctx := context.Background()
	var last *stellate.Mesh
	var err error
	if command == "save" {
		if last, err = stellate.LoadTxt(what); err == nil {
			err = last.Save(path)
		}
		if err == nil {
			return "saved"
		}
	} else if command == "create" {
		_, err = client.Create(ctx, stellate.Torus{Major: 1, Minor: 0.4}, 1, &stellate.Options{Label: what})
	} else {
		for mesh, failed := range client.Watch(ctx, what, nil) {
			last, err = mesh, failed
		}
	}
	var ours *stellate.Error
	if errors.As(err, &ours) {
		if ours.Kind != stellate.ErrCancelled || ours.Mesh == nil {
			return fmt.Sprint("error ", strings.ReplaceAll(ours.Kind.Error(), " ", ""), " ", ours.Reason)
		}
		last = ours.Mesh
	} else if err != nil {
		log.Fatal(err)
	}
	if err := last.Save(path); err != nil {
		log.Fatal(err)
	}
	return fmt.Sprint("mesh ", last.Revision,
		" ", name(last.Report.GetTermination(), pb.Termination_name, "TERMINATION_"),
		" ", name(last.Report.GetCertificate().GetLevel(), pb.CertificateLevel_name, "CERTIFICATE_LEVEL_"))
}

func main() {
	quiet := func(string) {}
	client, err := stellate.NewClient(stellate.Connection{Server: os.Args[1], OnOutage: quiet})
	if err != nil {
		log.Fatal(err)
	}
	defer client.Close()
	for {
		var command, what, path string
		if n, _ := fmt.Scanln(&command, &what, &path); n < 2 {
			return
		}
		fmt.Println(obey(client, command, what, path))
	}
}
