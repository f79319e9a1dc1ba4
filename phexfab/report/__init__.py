"""What a person looks at: pictures of the shell and its parts, and the HTML report."""
